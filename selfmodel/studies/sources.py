"""Source code outside of selfmodel that computes a cell: of its function, and of its plug-ins.

The code of a module is its file, those of the packages that contain it, and of all modules that
these import, at any depth, from the folder of the module or of its top-level package. Of an
installed package only its own modules count. Other libraries, files of data, and imports by a name
that is computed do not.
"""

import ast
import hashlib
import importlib.util
import os
from collections.abc import Iterator
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import search_here

OWN = __name__.partition(".")[0]
"""Package whose code is digested whole, with that of every cell."""

INSTALLED = ("site-packages", "dist-packages")
"""Names of the folders of installed packages."""


@cache
def sources_of(modules: tuple[str, ...]) -> dict[str, str]:
    """Returns the digests of the code of modules, by file, such as ``dtw.py``; none of selfmodel's.

    Each file is read once in a process, which imports it once.

    Raises:
        InputError: There is no file of a module.
    """
    search_here()
    digests: dict[str, str] = {}
    for module in modules:
        root, todo = _root(module), [module]
        if module.partition(".")[0] == OWN:
            continue
        if root is None or _file(module) is None:
            raise InputError(
                f"the file of the module {module} is not found on {os.uname().nodename}: write it "
                f"into a folder in PYTHONPATH there, or into the current folder"
            )
        while todo:
            name = todo.pop()
            path = _file(name) if _is_beside(name, module, root) else None
            # A namespace package may have several folders.
            key = f"{name.replace('.', '/')}{'/' if path and path.stem == '__init__' else '.'}"
            key += "__init__.py" if key.endswith("/") else "py"
            if path is not None and key not in digests:
                digests[key], imports = _read(path, name)
                todo += imports
            if "." in name:
                todo.append(name.rpartition(".")[0])
    return dict(sorted(digests.items()))


def _is_beside(name: str, module: str, root: Path) -> bool:
    tops = name.partition(".")[0], module.partition(".")[0]
    return tops[0] == tops[1] or (
        tops[0] != OWN and root.name not in INSTALLED and _root(name) == root
    )


def _spec(name: str) -> ModuleSpec | None:
    """Returns the specification of a module; no module is imported to find it."""
    package, _, _ = name.rpartition(".")
    if not package:
        try:
            return importlib.util.find_spec(name)
        except ValueError:  # of a module without one, such as __main__
            return None
    above = _spec(package)
    places = above and above.submodule_search_locations
    return PathFinder.find_spec(name, list(places)) if places else None


def _file(name: str) -> Path | None:
    spec = _spec(name)
    return Path(spec.origin) if spec and spec.has_location and spec.origin else None


def _root(name: str) -> Path | None:
    spec = _spec(name.partition(".")[0])
    if spec is None:
        return None
    if spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations))).parent
    return Path(spec.origin).parent if spec.has_location and spec.origin else None


@cache
def _read(path: Path, name: str) -> tuple[str, tuple[str, ...]]:
    """Returns the digest of a file, and the names of modules and objects that it imports."""
    code = path.read_bytes()
    try:
        tree = ast.parse(code if path.suffix == ".py" else b"")
    except (SyntaxError, ValueError) as error:
        raise InputError(f"{path}: expected Python: {error}; correct it") from error
    imports = _imports(tree, name if path.stem == "__init__" else name.rpartition(".")[0])
    return hashlib.sha256(code).hexdigest()[:16], tuple(dict.fromkeys(imports))


def _imports(tree: ast.Module, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: package.count(".") + 2 - node.level] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            yield source
            yield from (f"{source}.{alias.name}" for alias in node.names)
