"""Promises of the examples and the notebook: each runs, and draws or prints what it promises."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from selfmodel.logs.journal import is_calibrated
from selfmodel.studies.statistics import Interval
from selfmodel.testing import check_comparator
from tests.helpers.command import SMALL, as_started_in, selfmodel
from tests.helpers.gaits import batch, changed, gait, logged

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def run(name: str, *arguments: str, cwd: Path) -> str:
    """Runs an example in a folder, as ``python NAME``, and returns what it printed."""
    path = {"PYTHONPATH": str(EXAMPLES)}
    with as_started_in(cwd, [name, *arguments], path), redirect_stdout(StringIO()) as told:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    return told.getvalue()


@pytest.mark.process
def test_a_recovery_in_python_is_drawn_from_its_logs(tmp_path: Path):
    told = run("recover_in_python.py", "run", cwd=tmp_path)
    run("plot_recovery.py", "run", "figure.png", cwd=tmp_path)

    assert "(the truth: break:back_left_shoulder)" in told
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "run" / "trials").glob("*.mcap"))) == 3
    assert not is_calibrated(tmp_path / "run"), "a report of the run must not calibrate"


@pytest.mark.opengl
@pytest.mark.usefixtures("gl")
def test_lanes_are_drawn_with_the_opengl_that_works_of_itself(tmp_path: Path):
    folder, figure = ROOT / "tests" / "data" / "logs-0.1" / "recovery", tmp_path / "lanes.png"
    command = [sys.executable, EXAMPLES / "plot_lanes.py", folder, figure]
    subprocess.run(command, env={**os.environ, "MUJOCO_GL": ""}, check=True)
    with Image.open(figure) as picture:
        numbers = [picture.info[stage] for stage in ("before", "after", "recovery")]
        pixels = np.asarray(picture.convert("RGB"), int)[:, 320:].reshape(-1, 3)

    assert numbers == ["0.2", "0.3", "0.2"]
    blue, red, green = (pixels[:, k] - np.delete(pixels, k, 1).max(1) for k in (2, 0, 1))
    assert min(np.sum(each > 20) for each in (blue, red, green)) > 500  # beside the caption


@pytest.mark.process
def test_a_robot_that_breaks_while_it_is_watched_is_explained(tmp_path: Path):
    walk = ("trial", "quadruped", "--controller", "cpg", "--gap", "0.05", "--steps", "2400")
    logged = selfmodel(*walk, "--out", "healthy.mcap", cwd=tmp_path)
    told = run("watch_a_robot.py", "healthy.mcap", cwd=tmp_path)
    first, alarm, *_, last = told.splitlines()

    assert logged.returncode == 0, logged.stderr
    assert "watching" in first
    assert 4.0 < float(alarm.split()[0]) < 5.0
    assert last.endswith("the limb has come off at the joint front_left_knee")


def turning(rate: float) -> np.ndarray:
    """Orientations of a base that turns to the left, rad/s."""
    half = np.arange(1000) * 0.01 * rate / 2
    return np.column_stack([np.cos(half), np.zeros(1000), np.zeros(1000), np.sin(half)])


def test_a_comparator_of_ones_own_keeps_the_contract():
    with as_started_in(EXAMPLES, [], {}):
        heading = import_module("heading_comparator").HEADING
    left = changed(gait(), base_orientation=turning(0.1))
    unknown = turning(0.1)
    unknown[200:300] = np.nan
    trial = logged(changed(left, base_orientation=unknown))
    runs = batch(left, gait(), changed(gait(), base_orientation=turning(-0.1)))

    check_comparator(heading, logged(left), runs)
    check_comparator(heading, trial, runs)
    # A mean over 10 s of turning 0.1 rad/s apart.
    losses = heading.prepare(logged(left)).losses(runs)
    np.testing.assert_allclose(losses.mean(axis=1), [0, 0.4995, 0.999], rtol=1e-6)


@pytest.mark.process
def test_a_comparator_of_ones_own_plugs_in_from_the_folder_that_the_command_runs_in(tmp_path: Path):
    shutil.copy(EXAMPLES / "heading_comparator.py", tmp_path)
    (tmp_path / "multiprocessing.py").write_text("raise SystemExit('this is no plug-in')")
    command = [
        *(Path(sys.executable).with_name("selfmodel"), "ablate", "--robots", "quadruped"),
        *("--case", "2", *SMALL, "--trials", "1", "--steps", "60", "--workers", "1"),
        *("--comparator", "heading_comparator:HEADING", "--out", "run", "--json"),
    ]

    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)["rows"]
    assert row["comparator"] == "heading_comparator:HEADING"


def test_plugins_of_ones_own_are_checked_in_python(tmp_path: Path):
    logged = selfmodel("trial", "quadruped", "--out", "intact.mcap", cwd=tmp_path)
    told = run("check_plugins.py", "intact.mcap", cwd=tmp_path)

    assert logged.returncode == 0, logged.stderr
    assert told.startswith("heading: [0. ")
    assert "gravity: 12 faults that may be proposed" in told


@pytest.mark.process
def test_an_ablation_in_python_goes_on_where_it_was(tmp_path: Path):
    command = [sys.executable, EXAMPLES / "ablation.py", "folder"]
    first = subprocess.check_output(command, cwd=tmp_path, text=True)
    again = run("ablation.py", "folder", cwd=tmp_path)

    assert "4 rows, 0 failed: folder/results.csv" in first
    assert "11 of 11 were done before" in again
    assert len((EXAMPLES / "ablation.py").read_text(encoding="utf-8").splitlines()) < 40


NOTEBOOK = EXAMPLES / "comparators.ipynb"
PAGE = ROOT / "docs" / "results" / "comparators.md"


def cells() -> list[dict[str, Any]]:
    return json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]


def compared() -> str:
    """The part of the page with differences: the table of all pairs, and the findings."""
    text = PAGE.read_text(encoding="utf-8")
    pairs = text.partition("## Which comparator is better")[2].partition("Bold: better.")[0]
    findings = text.partition("## Findings")[2].partition("## False alarms")[0]
    return pairs + findings


def both_ways(difference: Interval) -> list[str]:
    """A difference as the page states it, and that of the second method from the first."""
    ends = (difference.estimate, difference.low, difference.high)
    return [
        "{} ({} to {}".format(*(f"{round(value, 2) + 0:.2f}".replace("-", "−") for value in turned))  # noqa: RUF001
        for turned in (ends, (-ends[0], -ends[2], -ends[1]))
    ]


def test_the_notebook_holds_no_output_that_could_be_of_other_code():
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells())


@pytest.mark.opengl
def test_the_notebook_redraws_every_figure_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / "examples"
    folder.mkdir()
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    for cell in cells():
        if cell["cell_type"] == "code":
            lines = [line for line in cell["source"] if not line.startswith("%")]  # IPython's own
            exec(compile("".join(lines), cell["id"], "exec"), names)  # noqa: S102  # our notebook
    drawn = {path.name for path in (folder / "figures").iterdir()}
    shown = {Path(name).stem for name in re.findall(r"!\[.*\]\((.+)\)", PAGE.read_text())}

    assert drawn == {f"{name}.{suffix}" for name in shown for suffix in ("png", "pdf", "svg")}
    made = ("at_each_gap_too", "by_trials", "by_gap_alone", "without_position")
    known = {
        text
        for name in made
        for row in names[name].itertuples()
        for text in both_ways(Interval(row.difference, row.difference_low, row.difference_high))
    }
    stated = re.findall(r"−?\d\.\d\d \(−?\d\.\d\d to −?\d\.\d\d(?=[),])", compared())  # noqa: RUF001
    assert len(stated) >= 20
    assert set(stated) - known == set()
    assert len(names["pairs"]) == 4 * 21
    assert set(names["pairs"]["n"]) == {144, 432}
    assert (names["means"]["cells"] == 36).all()
