"""Directive ``room``: the public names of a package, by module, from their docstrings."""

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata


class Room(SphinxDirective):
    """Documents the modules of one package.

    Of a package with ``__all__``, these are the modules that define its names, with everything in
    them that has a docstring, and those of its constants that have none: of what class they are.
    Each name is documented under the module that defines it, because the docstring of a constant is
    in that module's source only.
    """

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns a section per module."""
        text = "\n".join(_lines(importlib.import_module(self.arguments[0])))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _lines(package: ModuleType) -> Iterator[str]:
    public = set(getattr(package, "__all__", ()))
    for module in (package, *_modules(package)):
        defined = {name: told for name, told in _defined(module) if not name.startswith("_")}
        if not (public & set(defined) if public else any(defined.values())):
            continue
        yield from (f"## `{module.__name__}`", "", "```{eval-rst}")
        yield f".. automodule:: {module.__name__}"
        if module is not package and module.__name__.rpartition(".")[2] in public:
            yield "   :no-index:"  # the package has a function with the name of its module
        for name in sorted(public & {name for name, told in defined.items() if not told}):
            yield from ("", f".. autodata:: {module.__name__}.{name}")
        yield from ("```", "")


def _modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not any(part.startswith("_") for part in found.name.split(".")):
            yield importlib.import_module(found.name)


def _defined(module: ModuleType) -> Iterator[tuple[str, bool]]:
    """Yields the classes, functions and constants that a module defines, and whether it says what.

    The docstring of a constant is the text after it.
    """
    body = ast.parse(inspect.getsource(module)).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.ClassDef | ast.FunctionDef):
            yield statement.name, True
            continue
        targets = statement.targets if isinstance(statement, ast.Assign) else ()
        targets = [statement.target] if isinstance(statement, ast.AnnAssign) else targets
        told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        names = (node for target in targets for node in ast.walk(target))
        yield from ((node.id, told) for node in names if isinstance(node, ast.Name))


def setup(sphinx: Sphinx) -> ExtensionMetadata:
    """Registers the directive."""
    sphinx.add_directive("room", Room)
    return {"parallel_read_safe": True}
