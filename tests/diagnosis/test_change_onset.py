"""A change in the middle of a trial: found in time, with the right hypotheses before and after.

Each trial consists of the rows of two simulated trials of one gait: before the onset those of the
intact robot, from the onset on those of a damaged one.
"""

import dataclasses

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

STEPS = 400
SMALL = dataclasses.replace(Settings().scaled(12), generations=2)
JAM = "jam:front_left_knee"
pytestmark = pytest.mark.search


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 1)[0]


def trial(robot: Robot, gait: Controller, truth: str, steps: int = STEPS) -> Trial:
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return in_memory(robot)(physical, TrialPlan(f"of-{truth}", "after", gait, steps, 0))


def glued(first: Trial, second: Trial, step: int) -> Trial:
    """The rows of one trial before a step, and of another from it on."""
    signals = {
        name: np.concatenate([values[:step], second.trajectory[name][step:]])
        for name, values in first.trajectory.signals.items()
    }
    trajectory = Trajectory(first.trajectory.names, first.trajectory.time, signals)
    return dataclasses.replace(second, trajectory=trajectory, path=f"glued-{step}.mcap")


def diagnosed(robot: Robot, *trials: Trial, intact: tuple[Trial, ...] = ()) -> Diagnosis:
    search = DiagnosticSearch(
        Simulator(robot, 1), SEGMENT_PREDICTION, SMALL, PAPER_KINDS, healthy_trials=intact
    )
    return search(list(trials), [], np.random.default_rng(0), lambda _: None)


def test_a_jam_in_the_middle_of_a_trial_is_found_and_dated(quadruped: Robot, gait: Controller):
    step = 120
    healthy = trial(quadruped, gait, "intact")
    damaged = glued(healthy, trial(quadruped, gait, JAM), step)
    found = diagnosed(quadruped, damaged, intact=(healthy,))
    onset = step * quadruped.control_timestep

    assert str(found.best) == JAM
    assert found.change is not None
    assert (found.change.before, str(found.change.after)) == (INTACT, JAM)
    assert (found.change.index, found.change.trial) == (0, f"glued-{step}")
    assert found.change.earliest <= onset <= found.change.latest
    assert abs(found.change.time - onset) <= 0.2


def test_a_jam_in_the_second_of_three_trials_is_dated_in_that_trial(
    quadruped: Robot, gait: Controller
):
    healthy, jammed = (trial(quadruped, gait, truth) for truth in ("intact", JAM))
    first = trial(quadruped, gait, "intact", steps=200)
    found = diagnosed(quadruped, first, glued(healthy, jammed, 180), jammed)

    assert str(found.best) == JAM
    assert found.change is not None
    assert (found.change.index, found.change.trial) == (1, "glued-180")
    assert abs(found.change.time - 1.8) <= 0.2
    assert found.trials == 3


def test_a_jam_of_a_robot_that_has_lost_a_limb_before_is_found_with_both_hypotheses(
    quadruped: Robot, gait: Controller
):
    lost = "break:back_right_knee"
    healthy = trial(quadruped, gait, "intact")
    before, after = (trial(quadruped, gait, truth) for truth in (lost, f"{lost}+{JAM}"))
    found = diagnosed(quadruped, glued(before, after, 150), intact=(healthy,))

    assert str(found.best) == f"{lost}+{JAM}"
    assert found.change is not None
    assert str(found.change.before) == lost
    assert abs(found.change.time - 1.5) <= 0.2
