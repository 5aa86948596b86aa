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

    A package with ``__all__`` documents those names only. Each name is documented under the module
    that defines it, because the docstring of a constant is in that module's source only; instances
    without a docstring, such as fault kinds, are listed.
    """

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Returns a section per module."""
        text = "\n".join(_lines(importlib.import_module(self.arguments[0])))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _lines(package: ModuleType) -> Iterator[str]:
    public = set(getattr(package, "__all__", ()))
    instances = set(public)
    for module in (package, *_modules(package)):
        names = [name for name in _defined(module) if not name.startswith("_")]
        if public:
            names = [name for name in names if name in public]
            instances -= set(names)
        if names:
            yield from (f"## `{module.__name__}`", "", "```{eval-rst}")
            yield from (f".. automodule:: {module.__name__}", f"   :members: {', '.join(names)}")
            if module is not package and module.__name__.rpartition(".")[2] in public:
                yield "   :no-index:"  # the package has a function with the name of its module
            yield from ("```", "")
    if instances:
        yield from ("", f"Instances: {', '.join(f'`{name}`' for name in sorted(instances))}.")


def _modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not any(part.startswith("_") for part in found.name.split(".")):
            yield importlib.import_module(found.name)


def _defined(module: ModuleType) -> Iterator[str]:
    """Yields the classes, functions and documented constants that a module defines."""
    body = ast.parse(inspect.getsource(module)).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.ClassDef | ast.FunctionDef):
            yield statement.name
        elif isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            targets = statement.targets if isinstance(statement, ast.Assign) else ()
            targets = [statement.target] if isinstance(statement, ast.AnnAssign) else targets
            yield from (target.id for target in targets if isinstance(target, ast.Name))


def setup(sphinx: Sphinx) -> ExtensionMetadata:
    """Registers the directive."""
    sphinx.add_directive("room", Room)
    return {"parallel_read_safe": True}
