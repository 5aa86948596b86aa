"""A physical trial is logged while it runs, and returned as its log has it."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError, TrialError
from selfmodel.logs import IncompleteError, read_log
from selfmodel.logs.physical_trial import MIN_STEPS, TrialRunner, run_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.physical.safety import HangError
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.signals import SIGNALS
from tests.logs.conftest import made_up, plan_of, timed

STEPS = 20


class Untimed:
    """A physical robot with made-up samples."""

    def __init__(self, robot: Robot, stops_after: int = 10**6) -> None:
        self._robot, self._stops_after = robot, stops_after

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields made-up samples that depend on the controller."""
        seed = int(controller.genome.sum() * 100) % 1000
        return made_up(self._robot, min(steps, self._stops_after), seed)


class Timed(Untimed):
    """A physical robot with a clock of its own."""

    def clock(self) -> float:
        """Returns a time."""
        return 0.0

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields made-up samples with their timing."""
        return timed(super().run(controller, steps))


@pytest.mark.parametrize("kind", [Untimed, Timed])
def test_the_trial_is_that_of_the_log_and_timed_as_the_robot_is(
    biped: Robot, tmp_path: Path, kind: type[Untimed]
):
    path = tmp_path / "trial.mcap"
    header = TrialHeader(Settings(), timed=kind is Untimed)  # the robot decides
    trial = run_trial(kind(biped), plan_of(biped, STEPS), path, biped, header)
    log = read_log(path)

    assert (log.timing is not None) == (kind is Timed)
    assert (trial.plan, trial.path) == (log.trial.plan, str(path))
    for signal in SIGNALS:
        assert trial.behaviour[signal].tobytes() == log.trial.behaviour[signal].tobytes()


def test_a_robot_that_stops_early_leaves_an_unfinished_log(biped: Robot, tmp_path: Path):
    run = TrialRunner(tmp_path, biped, Settings())
    with pytest.raises(IncompleteError, match=f"stopped after 5 of {STEPS} steps"):
        run(Untimed(biped, 5), plan_of(biped, STEPS, "00-before"))

    assert [file.name for file in tmp_path.iterdir()] == ["00-before.mcap.part"]


class Falling(Untimed):
    """A physical robot that cannot finish its trial."""

    def __init__(self, robot: Robot, stops_after: int, error: TrialError) -> None:
        super().__init__(robot, stops_after)
        self._error = error

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields some samples, then raises the error."""
        yield from super().run(controller, steps)
        raise self._error


def test_a_trial_that_the_robot_cannot_finish_is_a_trial_as_far_as_it_goes(
    biped: Robot, tmp_path: Path
):
    run = TrialRunner(tmp_path, biped, Settings())
    robot = Falling(biped, MIN_STEPS, TrialError("a limit was exceeded"))
    plan = dataclasses.replace(plan_of(biped, 2 * MIN_STEPS, "02-recovery"), stage="recovery")
    trial = run(robot, plan)
    log = read_log(tmp_path / "02-recovery.mcap")

    assert (trial.plan.steps, trial.behaviour.steps) == (2 * MIN_STEPS, MIN_STEPS)
    assert (log.status, log.reason) == ("stopped", "TrialError: a limit was exceeded")


@pytest.mark.parametrize("case", ["short", "hanging", "not stopped", "before"])
def test_a_trial_that_is_too_short_or_whose_robot_is_not_safe_is_an_error(
    biped: Robot, tmp_path: Path, case: str
):
    error = HangError("step hangs") if case == "hanging" else TrialError("it fell")
    if case == "not stopped":
        error.add_note("the safe command could not be sent")
    robot = Falling(biped, MIN_STEPS - (case == "short"), error)
    run = TrialRunner(tmp_path, biped, Settings())
    plan = plan_of(biped, 2 * MIN_STEPS, "02-recovery")
    stage = "before" if case == "before" else "recovery"
    with pytest.raises(TrialError, match=str(error)):
        run(robot, dataclasses.replace(plan, stage=stage))


def test_a_plan_names_the_log_and_a_name_that_is_none_is_refused(biped: Robot, tmp_path: Path):
    run = TrialRunner(tmp_path, biped, Settings())
    trial = run(Untimed(biped), plan_of(biped, STEPS, "07-after"))

    assert trial.path == str(tmp_path / "07-after.mcap")
    with pytest.raises(InputError, match="a trial's name names its file"):
        run(Untimed(biped), plan_of(biped, STEPS, "../out"))
