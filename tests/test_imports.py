"""Promises of the layering: dependencies point one way, and what needs no MuJoCo has none."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"selfmodel": "selfmodel", "tasks": "selfmodel.tasks"}
FOLDERS |= {name: f"selfmodel.{name}" for name in ("comparators", "logs")}
ADDED = ("selfmodel.tasks", "selfmodel.comparators", "selfmodel.logs")


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


def test_there_are_modules_to_look_at():
    assert {"selfmodel.robot", "selfmodel.tasks.quadruped", "selfmodel.logs"} < set(modules())


@pytest.mark.parametrize("module", sorted(modules()))
def test_dependencies_point_one_way(module: str):
    imported = imports(modules()[module])
    if module.startswith(("selfmodel.cli", "selfmodel.__main__")):
        return
    own = next((package for package in ADDED if module.startswith(package)), None)
    forbidden = [package for package in (*ADDED, "selfmodel.cli") if package != own]
    wrong = {name for name in imported if name.startswith(tuple(forbidden))}

    assert not wrong, f"{module} must not import {wrong}"


LAYERS = (
    # Plain data and plain algorithms; then MuJoCo; then what takes a comparator; then the story.
    (
        *(
            "atomic",
            "errors",
            "ending",
            "arrays",
            "rotation",
            "differences",
            "behaviour",
            "anatomy",
            "cases",
            "controller",
            "attached",
            "untrusted",
        ),
        *(
            "settings",
            "memo",
            "evolution",
            "playback",
            "oscillators",
            "driver",
            "streams",
            "intervals",
        ),
        *("workers", "grid", "stopwatch"),
    ),
    (
        "faults",
        "hypothesis",
        "notation",
        "considered",
        "genome",
        "diagnosis",
        "trial",
        "comparator",
        "contract",
        "estimate",
        "losses",
        "significance",
        "events",
    ),
    (
        *("transmission", "couplings", "roots", "carried", "dissection", "activations"),
        *("commands", "neurons", "mjcf"),
        *("embodiment", "robot", "places", "noise", "senses", "batches", "tally", "prediction"),
        *("felt", "gap", "instruments", "start", "debris", "structure", "contract_kind"),
        *("simulator", "physical", "judge", "replay", "poses", "parameters", "disagreement"),
        *("limits", "environment_robot", "score", "stretches"),
    ),
    (
        *("database", "evidence", "screen", "refine", "degrees"),
        *("mending", "outside", "unseen", "diagnose"),
        *("repair", "calibrate", "next_trial"),
    ),
    ("recover", "explain"),
)


def layer(module: str) -> int:
    """The layer of a module of the core."""
    name = module.split(".")[1]
    return next(i for i, names in enumerate(LAYERS) if name in names)


@pytest.mark.parametrize(
    "module",
    sorted(m for m in modules() if m.count(".") and not m.startswith((*ADDED, "selfmodel.cli"))),
)
def test_a_layer_of_the_core_imports_none_above_it(module: str):
    if module == "selfmodel.__main__":
        return
    # What stands under TYPE_CHECKING is not imported.
    source = modules()[module].read_text(encoding="utf-8")
    runtime = ast.parse(source.split("if TYPE_CHECKING:\n    from")[0])
    imported = {
        node.module
        for node in ast.walk(runtime)
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("selfmodel.")
    }

    assert [name for name in imported if layer(name) > layer(module)] == []


@pytest.mark.parametrize("module", sorted(modules()))
def test_the_folders_are_imported_under_one_name(module: str):
    roots = {name.split(".")[0] for name in imports(modules()[module])}

    assert not roots & {"tasks", "comparators", "logs"}


@pytest.mark.parametrize(
    "module",
    [
        *("selfmodel.evolution", "selfmodel.comparators", "selfmodel.logs", "selfmodel.notation"),
        *("selfmodel.grid", "selfmodel.intervals"),
    ],
)
def test_what_needs_no_simulator_imports_without_mujoco(module: str):
    code = f"import sys; sys.modules['mujoco'] = None; import {module}"

    subprocess.run([sys.executable, "-c", code], check=True)


def test_help_imports_neither_mujoco_nor_dm_control_nor_scipy():
    slow = "{'mujoco', 'dm_control', 'scipy'}"
    code = f"import sys, selfmodel.cli; assert not {slow} & set(sys.modules)"

    subprocess.run([sys.executable, "-c", code], check=True)


def test_no_file_is_longer_than_four_hundred_lines():
    lengths = {
        str(path): len(path.read_text(encoding="utf-8").splitlines())
        for path in [*modules().values(), *(ROOT / "tests").rglob("*.py")]
    }

    assert not {path: length for path, length in lengths.items() if length > 400}
