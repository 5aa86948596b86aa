import json
import math
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError, WorkError, describe
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.events import SearchBegins
from selfmodel.report.progress import SEARCHES, ProgressRecorder, read_searches
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers


def recorded() -> ProgressRecorder:
    recorder = ProgressRecorder(lambda _event: None)
    recorder(SearchBegins("repair", INTACT))
    recorder(Generation(1, 2, 0.1, 20, 1.0))
    recorder(Generation(2, 2, 0.30000000000000004, 30, 2.0))
    recorder(SearchBegins("diagnostic"))
    recorder(Generation(1, 2, -math.inf, 20, 1.0))
    return recorder


def test_every_event_is_handed_on():
    handed = []
    event = SearchBegins("diagnostic")

    ProgressRecorder(handed.append)(event)

    assert handed == [event]


def test_the_progress_is_read_back_from_the_folder(tmp_path: Path):
    recorder = recorded()

    recorder.write(tmp_path)

    assert read_searches(tmp_path) == recorder.searches
    assert [one.best for one in recorder.searches] == [(0.1, 0.30000000000000004), (-math.inf,)]
    assert [one.hypothesis for one in recorder.searches] == ["intact", ""]


@pytest.mark.parametrize("kind", [WorkError, InputError, KeyboardInterrupt])
def test_a_failure_keeps_the_progress_and_names_the_folder_of_the_finished_trials(
    tmp_path: Path, quadruped: Robot, kind: type[BaseException]
):
    recorder = recorded()
    with pytest.raises(kind) as early, recorder.kept_on_failure(tmp_path):
        raise kind("before the first trial")
    (gait,) = random_controllers(quadruped, 1)
    plan = TrialPlan("00-before", "before", gait, 1, 0)
    recorder(Trial(plan, "quadruped", Behaviour(quadruped.anatomy.names, np.zeros(1), {}), "log"))
    with pytest.raises(kind) as failure, recorder.kept_on_failure(tmp_path):
        raise kind("the robot is gone")

    assert describe(early.value) == "before the first trial"
    assert describe(failure.value) == f"the robot is gone; the finished trials are in {tmp_path}"
    assert read_searches(tmp_path) == recorder.searches


def test_a_failure_before_any_search_writes_nothing(tmp_path: Path):
    recorder = ProgressRecorder(lambda _event: None)
    with pytest.raises(InputError, match="another run"), recorder.kept_on_failure(tmp_path):
        raise InputError("the folder has another run")

    assert not list(tmp_path.iterdir())


def test_a_failure_is_reported_though_the_progress_cannot_be_written(tmp_path: Path):
    recorder, gone = recorded(), tmp_path / "gone"
    with pytest.raises(WorkError, match="the robot is gone"), recorder.kept_on_failure(gone):
        raise WorkError("the robot is gone")


def test_a_folder_without_progress_has_none(tmp_path: Path):
    assert read_searches(tmp_path) == ()


LONG = '[{"kind": "repair", "hypothesis": "", "best": [1%s], "evaluations": [1]}]' % ("0" * 400)


@pytest.mark.parametrize("text", ["{", "[1]", '[{"kind": "repair"}]', '[{"best": [NaN]}]', LONG])
def test_a_damaged_file_is_named(tmp_path: Path, text: str):
    (tmp_path / SEARCHES).write_text(text)

    with pytest.raises(InputError, match=r"searches\.json: expected the progress"):
        read_searches(tmp_path)


def test_a_recovery_leaves_its_progress(run: Path):
    searches = read_searches(run)

    assert [one.kind for one in searches] == ["repair", "diagnostic", "repair", "diagnostic"]
    assert all(0 < len(one.best) == len(one.evaluations) for one in searches)
    assert json.loads((run / SEARCHES).read_text())[2]["hypothesis"] != ""
