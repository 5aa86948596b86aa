"""Sphinx configuration; ``make docs`` builds the site."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

os.environ.setdefault("MUJOCO_GL", "disable")  # dm_control searches for a display on import

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
