"""The progress of a recovery in its folder, and the report that is rewritten while it goes on."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError, WorkError, describe
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.results import SEARCHES, read_searches
from selfmodel.recovery.result import SearchBegins
from selfmodel.report.progress import RunProgress
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.command import selfmodel
from tests.helpers.drivers import random_controllers

RECOVER = (
    *("recover", "quadruped", "--case", "2", "--population", "4", "--generations", "1"),
    *("--steps", "40", "--trials", "1", "--repair", "paper", "--kinds", "break"),
    *("--comparator", "forward-displacement"),
)


def recorded(folder: Path, robot: Robot) -> RunProgress:
    progress = RunProgress(folder, robot, reports=True)
    progress(SearchBegins("repair", INTACT))
    progress(Generation(1, 2, 0.1, 20, 1.0))
    progress(Generation(2, 2, 0.30000000000000004, 30, 2.0))
    progress(SearchBegins("diagnostic"))
    progress(Generation(1, 2, -math.inf, 20, 1.0))
    return progress


@pytest.mark.parametrize("kind", [WorkError, KeyboardInterrupt])
def test_a_failure_keeps_the_searches_and_names_the_folder_of_the_finished_trials(
    tmp_path: Path, quadruped: Robot, kind: type[BaseException]
):
    with pytest.raises(kind), RunProgress(tmp_path, quadruped).kept_on_failure():
        raise kind("the folder has another run")
    assert not list(tmp_path.iterdir()), "an error before any search leaves the folder as it is"
    progress = recorded(tmp_path / "no-folder", quadruped)
    with pytest.raises(kind, match="gone"), progress.kept_on_failure():
        raise kind("the robot is gone")
    progress = recorded(tmp_path, quadruped)
    with pytest.raises(kind) as early, progress.kept_on_failure():
        raise kind("before the first trial")
    (gait,) = random_controllers(quadruped, 1)
    plan = TrialPlan("00-before", "before", gait, 1, 0)
    progress(Trial(plan, "quadruped", Trajectory(quadruped.anatomy.names, np.zeros(1), {}), "log"))
    with pytest.raises(kind) as failure, progress.kept_on_failure():
        raise kind("the robot is gone")

    assert describe(early.value) == "before the first trial"
    assert describe(failure.value) == f"the robot is gone; the finished trials are in {tmp_path}"
    assert read_searches(tmp_path) == progress.searches
    assert [one.best for one in progress.searches] == [(0.1, 0.30000000000000004), (None,)]
    assert [one.hypothesis for one in progress.searches] == ["intact", ""]
    page = (tmp_path / "report.html").read_text()
    assert "The recovery is not finished: the trial 00-before was run." in page


LONG = '[{"kind": "repair", "hypothesis": "", "best": [1%s], "evaluations": [1]}]' % ("0" * 400)


@pytest.mark.parametrize("text", ["{", "[1]", LONG])
def test_a_damaged_file_is_named_and_a_folder_without_one_has_none(tmp_path: Path, text: str):
    assert read_searches(tmp_path) == ()
    (tmp_path / SEARCHES).write_text(text)

    with pytest.raises(InputError, match=r"searches\.json: expected the progress"):
        read_searches(tmp_path)


@pytest.mark.search
def test_a_recovery_rewrites_its_report_which_states_whether_it_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pages: list[tuple[str, int]] = []

    def kept(path: Path, data: bytes) -> None:
        if path.name == "report.html":
            text = data.decode().partition('id="report">')[2].partition("</script>")[0]
            values = json.loads(text)
            pages.append((values["headline"], len(values["sections"])))
        path.write_bytes(data)

    monkeypatch.setattr("selfmodel.report.progress.replace_file", kept)
    plain, done = (
        selfmodel(*RECOVER, "--out", out, *options, cwd=tmp_path)
        for out, options in (("plain", ()), ("run", ("--report",)))
    )

    assert (plain.returncode, done.returncode) == (0, 0), plain.stderr + done.stderr
    assert f"report: {Path('run') / 'report.html'}" in done.stderr
    headlines = [headline for headline, _ in pages]
    assert headlines[0] == "The recovery is not finished: the trial 00-before was run."
    assert headlines[1] == "The recovery is not finished: the trial 01-after was run."
    assert headlines[2].startswith("The recovery is not finished: 1 trial of the quadruped. ")
    assert headlines[3].startswith("The recovery is not finished: 2 trials of the quadruped. ")
    assert pages[3][1] == 6
    last = (tmp_path / "run" / "report.html").read_text()
    assert '"headline":"The quadruped moved' in last
    # The recovery computes the same numbers with and without a report.
    for name in (SEARCHES, "diagnoses.json"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
    texts = ((tmp_path / folder / "result.json").read_text() for folder in ("plain", "run"))
    before, after = (json.loads(text.replace('"plain/', '"run/')) for text in texts)
    for key in ("seconds", "sha256"):
        del before[key], after[key]
    assert before == after
