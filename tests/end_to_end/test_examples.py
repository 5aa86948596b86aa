"""Promises of the examples: each runs as its usage says, and draws or prints what it promises."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from selfmodel.diagnosis.comparator import Comparator
from selfmodel.logs.journal import is_calibrated
from selfmodel.testing import check_comparator
from tests.helpers.command import SMALL, selfmodel
from tests.helpers.gaits import batch, changed, gait, logged

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name: str, *arguments: str, cwd: Path) -> str:
    """Runs an example in a folder and returns what it printed."""
    command = [sys.executable, EXAMPLES / name, *arguments]
    return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True).stdout


@pytest.mark.process
def test_a_recovery_in_python_is_drawn_from_its_logs(tmp_path: Path):
    told = run("recover_in_python.py", "run", cwd=tmp_path)
    run("plot_recovery.py", "run", "figure.png", cwd=tmp_path)

    assert "(the truth: break:back_left_shoulder)" in told
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "run" / "trials").glob("*.mcap"))) == 3
    assert not is_calibrated(tmp_path / "run"), "a report of the run must not calibrate"


def heading_comparator() -> Comparator:
    """The example's comparator, imported as its user's own file would be."""
    spec = importlib.util.spec_from_file_location("heading", EXAMPLES / "heading_comparator.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where a dataclass looks for its annotations
    spec.loader.exec_module(module)
    return module.HEADING


def turning(rate: float) -> np.ndarray:
    """Orientations of a base that turns to the left, rad/s."""
    half = np.arange(1000) * 0.01 * rate / 2
    return np.column_stack([np.cos(half), np.zeros(1000), np.zeros(1000), np.sin(half)])


def test_a_comparator_of_ones_own_keeps_the_contract():
    left = changed(gait(), base_orientation=turning(0.1))
    unknown = turning(0.1)
    unknown[200:300] = np.nan
    trial = logged(changed(left, base_orientation=unknown))
    runs = batch(left, gait(), changed(gait(), base_orientation=turning(-0.1)))

    check_comparator(heading_comparator(), logged(left), runs)
    check_comparator(heading_comparator(), trial, runs)
    # A mean over 10 s of turning 0.1 rad/s apart.
    losses = heading_comparator().prepare(logged(left)).losses(runs)
    np.testing.assert_allclose(losses.mean(axis=1), [0, 0.4995, 0.999], rtol=1e-6)


@pytest.mark.process
def test_a_comparator_of_ones_own_plugs_in_from_the_folder_that_the_command_runs_in(tmp_path: Path):
    command = [
        *(Path(sys.executable).with_name("selfmodel"), "recover", "quadruped", "--case", "2"),
        *(*SMALL, "--trials", "1", "--steps", "60", "--kinds", "break", "--repair", "paper"),
        *("--comparator", "heading_comparator:HEADING"),
        *("--out", tmp_path / "run", "--json"),
    ]

    done = subprocess.run(command, cwd=EXAMPLES, check=True, capture_output=True, text=True)

    assert json.loads(done.stdout)["comparator"] == "heading"


def test_plugins_of_ones_own_are_checked_in_python(tmp_path: Path):
    logged = selfmodel("trial", "quadruped", "--out", "intact.mcap", cwd=tmp_path)
    told = run("check_plugins.py", "intact.mcap", cwd=tmp_path)

    assert logged.returncode == 0, logged.stderr
    assert told.startswith("heading: [0. ")
    assert "gravity: 12 faults that may be proposed" in told


@pytest.mark.process
def test_an_ablation_in_python_goes_on_where_it_was(tmp_path: Path):
    first = run("ablation.py", "folder", cwd=tmp_path)
    again = run("ablation.py", "folder", cwd=tmp_path)

    assert "4 rows, 0 failed: folder/results.csv" in first
    assert "GridBegins(total=11, finished=11)" in again
    assert len((EXAMPLES / "ablation.py").read_text(encoding="utf-8").splitlines()) < 40
