"""Sphinx configuration; ``make docs`` builds the site."""

import os
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

os.environ.setdefault("MUJOCO_GL", "disable")  # dm_control searches for a display on import

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

import selfmodel

project = "selfmodel"
author = "the selfmodel developers"
copyright = author  # noqa: A001  # Sphinx reads this name
version = release = selfmodel.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "command_line",
    "complete",
    "mathml",
    "room",
]
exclude_patterns = ["_build"]
myst_enable_extensions = ["deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4  # a link to a heading is the one that GitHub makes

html_theme = "furo"
html_title = "selfmodel"
html_theme_options = {"top_of_page_buttons": []}
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_show_sphinx = False
html_show_copyright = False
copybutton_exclude = ".linenos, .gp, .go"

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
add_module_names = False
toc_object_entries_show_parents = "hide"

# selfmodel exports its names lazily; autodoc lists the names that are in a module already.
for name in getattr(selfmodel, "__all__", ()):
    setattr(selfmodel, name, getattr(selfmodel, name))

LONGEST_VALUE = 80  # characters


def plain_attribute(
    _app: Sphinx, what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Keeps napoleon from reading ``Noun: the rest`` of an attribute's docstring as a type."""
    if what in {"attribute", "data", "property"}:
        lines[:0] = ["..", ""]  # an empty comment, which has no colon


def readable_defaults(
    _app: Sphinx,
    _what: str,
    _name: str,
    _obj: object,
    _options: object,
    signature: str | None,
    returns: str | None,
) -> tuple[str | None, str | None]:
    """Replaces the ``repr`` of a function in a dataclass's signature by its name."""
    if signature is not None:
        signature = re.sub(r"<function (\w+)[^>]*>", r"\1", signature)
        signature = re.sub(r"= <[^>]*>+", "= ...", signature)
    return signature, returns


def without_long_values(_app: Sphinx, document: nodes.document) -> None:
    """Removes the value of a constant that is longer than a line."""
    for node in list(document.findall(addnodes.desc_annotation)):
        if node.astext().startswith(" = ") and len(node.astext()) > LONGEST_VALUE:
            node.parent.remove(node)


def setup(app: Sphinx) -> None:
    """Connects the corrections, the first before napoleon's own at 500."""
    app.connect("autodoc-process-docstring", plain_attribute, priority=400)
    app.connect("autodoc-process-signature", readable_defaults)
    app.connect("doctree-read", without_long_values)
