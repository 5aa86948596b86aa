"""Promises of the layering: dependencies point one way, and what needs no MuJoCo has none."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"selfmodel": "selfmodel", "tasks": "selfmodel.tasks"}
FOLDERS |= {name: f"selfmodel.{name}" for name in ("comparators", "logs")}


@cache
def modules() -> dict[str, Path]:
    """Every module of the package and its file."""
    found = {}
    for folder, package in FOLDERS.items():
        for path in (ROOT / folder).rglob("*.py"):
            inside = path.relative_to(ROOT / folder).with_suffix("").parts
            if folder == "selfmodel" and inside[0] in ("tasks", "comparators", "logs"):
                continue  # the symlinks
            found[".".join([package, *inside]).removesuffix(".__init__")] = path
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
def exports(module: str) -> set[str]:
    """The names that a face exports from its modules, by its stub; none for other modules."""
    stub = modules()[module].with_suffix(".pyi")
    if not stub.exists():
        return set()
    lines = ast.parse(stub.read_text(encoding="utf-8")).body
    return {f"{module}.{line.module}.{alias.name}" for line in lines for alias in line.names}


ROOMS = (
    "controllers",
    "trials",
    "robot",
    "faults",
    "simulation",
    "physical",
    "diagnosis",
    "recovery",
    "tasks",
    "comparators",
    "logs",
    "testing",
    "plugins",
    "arguments",
    "studies",
    "api",
    "report",
    "cli",
)
"""The rooms, in the order in which data flows: each may import itself and the rooms before it. Some
are a file: plug-ins, arguments, the public functions, and contract checks."""

VOCABULARY = ("arrays", "errors", "files", "isolation", "settings", "evolution", "version")
"""The files beside the rooms, which every room may import."""


def room(module: str) -> str | None:
    """The room of a module; None for the vocabulary and the public face."""
    name = module.split(".")[1] if "." in module else ""
    return name if name in ROOMS else None


@cache
def imported_modules(module: str) -> set[str]:
    """The modules that a module imports, under TYPE_CHECKING too, or a face exports."""
    known = modules()
    names = imports(known[module]) | exports(module)
    found = {name if name in known else name.rpartition(".")[0] for name in names}
    return {name for name in found if name in known and name != module}


def test_the_modules_are_found():
    assert {"selfmodel.robot.robot", "selfmodel.tasks.entry", "selfmodel.logs"} < set(modules())


def test_every_module_has_a_room_or_is_vocabulary():
    homeless = [
        module
        for module in modules()
        if room(module) is None and module.removeprefix("selfmodel.") not in VOCABULARY
    ]

    assert sorted(homeless) == ["selfmodel", "selfmodel.__main__"]


def test_one_module_imports_gymnasium_which_is_no_dependency():
    others = [
        module
        for module, path in modules().items()
        if {"gymnasium", "shimmy"} & {name.split(".")[0] for name in imports(path)}
    ]

    assert others == ["selfmodel.tasks.gymnasium_env"]


def test_few_files_lie_flat_in_the_package():
    assert len(list((ROOT / "selfmodel").glob("*.py"))) <= 13


@pytest.mark.parametrize("module", sorted(set(modules()) - {"selfmodel", "selfmodel.__main__"}))
def test_dependencies_point_one_way(module: str):
    own = room(module)
    allowed = ROOMS[: ROOMS.index(own) + 1] if own else ()
    beside = {"tasks", "comparators", "logs"} - {own}
    wrong = {
        name
        for name in imported_modules(module)
        if (there := room(name)) is not None
        and (there not in allowed or (own in ("tasks", "comparators", "logs") and there in beside))
    }

    assert not wrong, f"{module} must not import {wrong}"


def test_no_module_imports_itself_through_others():
    graph = {module: imported_modules(module) for module in modules()}
    reached: dict[str, set[str]] = {}
    for module, imported in graph.items():
        todo, seen = list(imported), set()
        while todo:
            name = todo.pop()
            if name not in seen:
                seen.add(name)
                todo.extend(graph[name])
        reached[module] = seen

    assert [module for module, seen in reached.items() if module in seen] == []


@pytest.mark.parametrize("module", sorted(modules()))
def test_the_folders_are_imported_under_one_name(module: str):
    roots = {name.split(".")[0] for name in imports(modules()[module])}

    assert not roots & {"tasks", "comparators", "logs"}


@pytest.mark.parametrize(
    "module",
    [
        *(
            "selfmodel.evolution",
            "selfmodel.comparators",
            "selfmodel.logs",
            "selfmodel.faults.notation",
        ),
        *("selfmodel.studies.grid", "selfmodel.studies.statistics"),
        "selfmodel.studies.comparisons",
    ],
)
def test_what_needs_no_simulator_imports_without_mujoco(module: str):
    code = f"import sys; sys.modules['mujoco'] = None; import {module}"

    subprocess.run([sys.executable, "-c", code], check=True)


def test_help_imports_neither_mujoco_nor_dm_control_nor_scipy():
    slow = "{'mujoco', 'dm_control', 'scipy'}"
    code = f"import sys, selfmodel.cli; assert not {slow} & set(sys.modules)"

    subprocess.run([sys.executable, "-c", code], check=True)


def test_no_file_is_longer_than_five_hundred_lines():
    lengths = {
        str(path): len(path.read_text(encoding="utf-8").splitlines())
        for path in [*modules().values(), *(ROOT / "tests").rglob("*.py")]
    }

    assert not {path: length for path, length in lengths.items() if length > 500}
