"""Check that the reference has every public name, and every name that a page imports.

A name is public if a package lists it in ``__all__``. The check is of what was documented, after a
build of all pages, and warns of what is missing.
"""

import ast
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging
from sphinx.util.typing import ExtensionMetadata

PACKAGE = "selfmodel"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INCLUDED = re.compile(r"^```\{literalinclude\} (.*\.py)$", re.MULTILINE)

_documented: set[str] = set()
"""Full names of what autodoc has documented, with those that are not in the index."""


def public_names() -> Iterator[tuple[str, str]]:
    """Yields the modules and names that the package and its own packages list."""
    root = Path(importlib.import_module(PACKAGE).__file__ or "").parent
    for folder in (root, *sorted(path.parent for path in root.glob("*/__init__.pyi"))):
        module = ".".join(folder.relative_to(root.parent).parts)
        yield from ((module, name) for name in importlib.import_module(module).__all__)


def imported_names(source: Path) -> Iterator[tuple[str, str]]:
    """Yields the modules and names that the Python code of the pages in a folder imports."""
    texts: list[str] = []
    for page in source.glob("**/*.md"):
        text = page.read_text(encoding="utf-8")
        included = [page.parent / name for name in INCLUDED.findall(text)]
        texts += [*BLOCK.findall(text), *(path.read_text(encoding="utf-8") for path in included)]
    for node in (node for text in texts for node in ast.walk(ast.parse(text))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
            yield from ((str(node.module), alias.name) for alias in node.names)


def is_documented(module: str, name: str, documented: set[str]) -> bool:
    """Returns whether a name is documented where it is found, or where it is defined."""
    if f"{module}.{name}" in documented:
        return True
    value = getattr(importlib.import_module(module), name)
    places = (full.rpartition(".")[0] for full in documented if full.endswith(f".{name}"))
    return any(getattr(sys.modules.get(place), name, None) is value for place in places)


def note_documented(_app: Sphinx, _what: str, name: str, *_rest: object) -> None:
    """Notes what autodoc documents."""
    _documented.add(name)


def warn_of_missing(app: Sphinx, env: BuildEnvironment) -> None:
    """Warns of each name that is neither noted nor in the index."""
    documented = _documented | set(env.domains.python_domain.objects)
    for module, name in sorted({*public_names(), *imported_names(Path(app.srcdir))}):
        if not is_documented(module, name, documented):
            logging.getLogger(__name__).warning("the reference lacks %s.%s", module, name)


def setup(sphinx: Sphinx) -> ExtensionMetadata:
    """Connects the check; it needs a build of all pages in one process, as `make docs` is."""
    sphinx.connect("autodoc-process-docstring", note_documented, priority=300)
    sphinx.connect("env-check-consistency", warn_of_missing)
    return {"parallel_read_safe": False}
