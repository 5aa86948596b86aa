"""Promises of the layering: dependencies point one way, and what needs no MuJoCo has none."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINKED = ("tasks", "comparators", "logs")
"""Rooms whose folders lie beside the package's."""

ROOMS = (
    *("controllers", "trials", "robot", "faults", "simulation", "physical", "diagnosis"),
    *(
        "recovery",
        *LINKED,
        "plugins",
        "arguments",
        "testing",
        "studies",
        "recording",
        "watching",
        "api",
    ),
    *("report", "cli"),
)
"""The rooms, in the order in which data flows: each may import itself and the rooms before it. Some
are a file: plug-ins, arguments, the public functions, and contract checks."""

VOCABULARY = (
    *("arrays", "errors", "files", "isolation", "settings", "evolution", "progress", "rotation"),
    *("opengl", "style", "version"),
)
"""The files beside the rooms, which every room may import."""

WITHOUT_SIMULATOR = (
    *("evolution", "comparators", "logs", "faults.notation"),
    *("studies.grid", "studies.statistics", "studies.comparisons"),
)


def python(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True)


@cache
def modules() -> dict[str, Path]:
    """Every module of the package and its file."""
    found = {}
    for folder in ("selfmodel", *LINKED):
        for path in (ROOT / folder).rglob("*.py"):
            inside = path.relative_to(ROOT).with_suffix("").parts
            if inside[0] == "selfmodel" and inside[1] in LINKED:
                continue  # the links
            package = inside if inside[0] == "selfmodel" else ("selfmodel", *inside)
            found[".".join(package).removesuffix(".__init__")] = path
    return found


@cache
def imports(path: Path) -> set[str]:
    """The names that a file imports, at its top or anywhere inside."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides which way it points"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@cache
def imported_modules(module: str) -> set[str]:
    """The modules that a module imports, under TYPE_CHECKING too, or a face exports by its stub."""
    known = modules()
    names = imports(known[module])
    if (stub := known[module].with_suffix(".pyi")).exists():
        lines = ast.parse(stub.read_text(encoding="utf-8")).body
        names |= {f"{module}.{line.module}.{alias.name}" for line in lines for alias in line.names}
    found = {name if name in known else name.rpartition(".")[0] for name in names}
    return {name for name in found if name in known and name != module}


def room(module: str) -> str | None:
    """The room of a module; None for the vocabulary and the public face."""
    name = module.split(".")[1] if "." in module else ""
    return name if name in ROOMS else None


def test_every_module_has_a_room_or_is_vocabulary():
    beside = {module for module in modules() if room(module) is None}

    assert beside == {
        "selfmodel",
        "selfmodel.__main__",
        *(f"selfmodel.{name}" for name in VOCABULARY),
    }


@pytest.mark.process
def test_one_module_imports_gymnasium_which_is_no_dependency():
    found = [
        module
        for module, path in modules().items()
        if {"gymnasium", "shimmy"} & {name.split(".")[0] for name in imports(path)}
    ]

    assert found == ["selfmodel.tasks.gymnasium_env"]


def test_dependencies_point_one_way_and_the_folders_are_imported_under_one_name():
    for module in set(modules()) - {"selfmodel", "selfmodel.__main__"}:
        own = room(module)
        allowed = set(ROOMS[: ROOMS.index(own) + 1]) if own else set()
        if own in LINKED:
            allowed -= set(LINKED) - {own}
        wrong = {name for name in imported_modules(module) if room(name) not in {None, *allowed}}

        assert not wrong, f"{module} must not import {wrong}"
        assert not {name.split(".")[0] for name in imports(modules()[module])} & set(LINKED)


def test_no_module_imports_itself_through_others():
    for module in modules():
        todo, seen = list(imported_modules(module)), set()
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo += imported_modules(name)

        assert module not in seen


@pytest.mark.process
def test_what_needs_no_simulator_imports_without_mujoco_and_a_face_and_help_without_numpy():
    python(f"""
import sys
import selfmodel, selfmodel.cli.commands
assert not {{"numpy", "mujoco", "scipy"}} & set(sys.modules)
sys.modules["mujoco"] = None
import {", ".join(f"selfmodel.{name}" for name in WITHOUT_SIMULATOR)}
""")


@pytest.mark.parametrize("folder", ["selfmodel", *LINKED, "tests"])
def test_no_file_is_longer_than_five_hundred_lines(folder: str):
    lengths = {
        str(path): len(path.read_text(encoding="utf-8").splitlines())
        for path in (ROOT / folder).rglob("*.py")
    }

    assert not {path: length for path, length in lengths.items() if length > 500}
