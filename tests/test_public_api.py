"""Promises of the public interface: its names, lazy imports, documented and runnable examples."""

import ast
import doctest
import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import selfmodel

ROOT = Path(__file__).parents[1]
FACES = sorted(path.parent for path in (ROOT / "selfmodel").glob("*/__init__.py"))
FACES = [folder for folder in FACES if "lazy_loader" in (folder / "__init__.py").read_text()]

PUBLIC = {
    *("load_robot", "Robot", "Hypothesis", "FaultKind", "ALL_KINDS", "PAPER_KINDS"),
    *("parse_hypothesis", "Simulator", "simulated_robot", "EnvironmentRobot", "PhysicalRobot"),
    *("Controller", "Trial", "Trajectory", "evolve", "run_trial", "read_log"),
    "RepairSettings",
    *("write_log", "record", "evaluate", "Episode", "Study", "load"),
    *("calibrate", "diagnose", "Diagnosis", "recover", "Recovery", "replay", "Settings"),
    *("Comparator", "check_comparator", "check_fault_kind", "check_score", "check_next_trial"),
    *("check_design", "check_search", "load_policy", "export_diagnosis", "ContractError"),
    "Watch",
    "__version__",
}

LOGS = ROOT / "tests" / "data" / "logs-0.1" / "recovery" / "trials"

WITHOUT_EXAMPLE = {
    **dict.fromkeys(("ALL_KINDS", "PAPER_KINDS", "__version__"), "a constant"),
    **dict.fromkeys(("Comparator", "PhysicalRobot"), "a protocol, implemented by the user"),
    **dict.fromkeys(("Controller", "Diagnosis", "Recovery", "Robot", "Trial"), "a returned record"),
    "Episode": "a returned record",
    "ContractError": "an error",
    **dict.fromkeys(("Study", "load"), "a module or a folder is needed: docs have one"),
    "EnvironmentRobot": "an environment is needed: docs and tests/end_to_end drive one",
    "FaultKind": "an example is a whole plug-in: docs have one",
}
"""Public names without an example, and the reason."""


def names_for_type_checkers(stub: Path) -> set[str | None]:
    """The names that the stub of a face exports: those imported ``as`` themselves."""
    lines = ast.parse(stub.read_text(encoding="utf-8")).body
    return {alias.asname for line in lines for alias in line.names}


def test_the_public_names_are_these():
    assert set(selfmodel.__all__) == PUBLIC


@pytest.mark.parametrize("folder", [ROOT / "selfmodel", *FACES], ids=lambda folder: folder.name)
def test_a_face_exports_the_names_that_type_checkers_see(folder: Path):
    package = ".".join(folder.relative_to(ROOT).parts)
    face = importlib.import_module(package)

    assert set(face.__all__) == names_for_type_checkers(folder / "__init__.pyi")
    assert all(hasattr(face, name) for name in face.__all__)


@pytest.mark.parametrize("name", sorted(PUBLIC - set(WITHOUT_EXAMPLE)))
def test_the_example_of_every_public_name_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for log in ("before", "after"):
        (found,) = LOGS.glob(f"*-{log}.mcap")
        shutil.copy(found, tmp_path / f"{log}.mcap")
    monkeypatch.chdir(tmp_path)
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(selfmodel, name), name, globs={})

    result = doctest.DocTestRunner().run(example)

    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.process
def test_a_folder_that_is_called_selfmodel_does_not_come_before_the_package(tmp_path: Path):
    """It is a namespace package, to which an install by an import hook would lose."""
    (tmp_path / "selfmodel").mkdir()
    code = "import selfmodel as s; from selfmodel import tasks; print(s.diagnose, tasks.__file__)"
    told = subprocess.check_output([sys.executable, "-c", code], cwd=tmp_path, text=True)

    assert told.startswith("<function diagnose at ")
    assert told.split()[-1] == str(ROOT / "selfmodel" / "tasks" / "__init__.py")
