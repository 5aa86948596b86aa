"""A robot is accused only of what its healthy trials, or a refit of the self-model, exclude."""

import dataclasses

import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.controllers.playback import played_back
from selfmodel.diagnosis.adequacy import COVERAGE, doubt_of, faster_joints
from selfmodel.diagnosis.diagnosis import Doubt, Fit
from selfmodel.diagnosis.losses import LossTable, Problem
from selfmodel.diagnosis.significance import LOSS_RATIO
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.model_factors import model_with_parameters, nominal, with_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPlan, trial_names
from tests.helpers.drivers import random_motion
from tests.helpers.memory import in_memory

STEPS = 400
KNEE = "front_left_knee"
WEAK = f"motor:{KNEE}=0.5"


@pytest.fixture(scope="module")
def real(quadruped: Robot) -> Robot:
    """The robot itself: other masses and damping than those of the self-model."""
    return unlike(quadruped)


def unlike(robot: Robot, knee: float = 1.0) -> Robot:
    """A robot with other masses and damping, and a factor of the torque of the front left knee."""
    gains = np.ones(robot.model.nu)
    gains[robot.anatomy.motors.index(KNEE)] = knee
    own = dataclasses.replace(
        nominal(robot), root_mass=1.2, limb_mass=0.8, damping=2.5, motor_gains=tuple(gains)
    )
    return with_model(robot, model_with_parameters(robot, own), robot.control_delay)


def moved(robot: Robot, path: str, *, seed: int = 0, pace: int = 1, truth: str = "intact") -> Trial:
    """A trial of a robot under sinusoids, ``pace`` times as fast as those of the seed."""
    sizes = np.random.default_rng(seed).uniform(0.2, 1.0, robot.model.nu)
    commands = sizes * random_motion(robot, pace * STEPS, seed)[::pace]
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    plan = TrialPlan("imported", "after", played_back(robot.anatomy.motors, commands), STEPS, 0)
    return dataclasses.replace(in_memory(robot)(physical, plan), path=path)


def doubted(
    model: Robot,
    trial: Trial,
    healthy: Trial,
    accused: str,
    *,
    refit: Robot | None = None,
    left: float | None = None,
    ratio: float = 2.0,
) -> Doubt | None:
    """The doubt about an accusation.

    A refit of the self-model to all trials gives ``refit``, or no other; the trial has ``ratio``
    times the loss of the healthy one.
    """
    problem = problem_of(model, trial, healthy, refit)
    hypothesis = parse(accused, model.anatomy)
    intact = ratio * problem.table.losses([INTACT], [healthy]).mean()
    fit = Fit(intact / 2, intact, None, None, 6.0, bool(hypothesis), left)
    return doubt_of(hypothesis, fit, problem)


def problem_of(model: Robot, trial: Trial, healthy: Trial, refit: Robot | None = None) -> Problem:
    table = LossTable(Simulator(model, 1), SEGMENT_PREDICTION)
    return Problem(
        table,
        HypothesisSpace.of(DEFAULT_KINDS, model.anatomy),
        [trial],
        surrogate=table.surrogate([trial]),
        healthy_trials=[healthy],
        names=trial_names([trial]),
        settings=Settings(),
        calibrate=lambda _: refit or model,
    )


def test_what_a_refit_explains_without_a_fault_is_no_fault(quadruped: Robot, real: Robot):
    healthy = moved(real, "healthy.mcap", seed=2)
    trial = moved(real, "trial.mcap", seed=9, truth=WEAK)

    doubt = doubted(quadruped, trial, healthy, WEAK, refit=unlike(quadruped, 0.5))

    assert doubt is not None
    assert WEAK in doubt.reason
    assert doubted(quadruped, trial, healthy, WEAK) is None


@pytest.mark.parametrize(("left", "is_doubted"), [(0.4, False), (0.6, True)])
def test_a_fault_that_leaves_most_of_the_loss_of_another_gait_is_doubted(
    quadruped: Robot,
    real: Robot,
    left: float,
    is_doubted: bool,  # noqa: FBT001  # a column
):
    healthy = moved(real, "healthy.mcap", seed=2)
    trial = moved(real, "trial.mcap", seed=9, truth=WEAK)

    assert (doubted(quadruped, trial, healthy, WEAK, left=left) is not None) == is_doubted


def test_a_trial_with_the_gait_of_a_healthy_one_needs_no_refit(quadruped: Robot, real: Robot):
    healthy, trial = (moved(real, f"{name}.mcap", seed=2) for name in ("healthy", "trial"))

    assert doubted(quadruped, trial, healthy, WEAK, refit=real) is None


@pytest.mark.parametrize("accused", ["intact", WEAK])
def test_a_loss_beyond_any_model_error_is_not_doubted(quadruped: Robot, real: Robot, accused: str):
    healthy, trial = moved(real, "healthy.mcap", seed=2), moved(real, "trial.mcap", seed=9)

    small, large = (
        doubted(quadruped, trial, healthy, accused, refit=real, ratio=LOSS_RATIO * factor)
        for factor in (0.9, 1.3)
    )

    assert small is not None
    assert large is None


@pytest.mark.parametrize(("pace", "is_covered"), [(1, True), (2, False)])
def test_a_joint_that_moves_faster_than_in_the_healthy_trials_is_not_accused(
    quadruped: Robot,
    real: Robot,
    pace: int,
    is_covered: bool,  # noqa: FBT001  # a column
):
    healthy = moved(real, "healthy.mcap", seed=2)
    trial = moved(real, "trial.mcap", seed=2, pace=pace)

    doubt = doubted(quadruped, trial, healthy, WEAK)

    assert (doubt is None) == is_covered
    assert doubt is None or KNEE in doubt.reason


def test_an_unexplained_motion_of_another_gait_is_not_judged_and_of_the_same_gait_is(
    quadruped: Robot, real: Robot
):
    healthy = moved(real, "healthy.mcap", seed=2)

    assert doubted(quadruped, moved(real, "other.mcap", seed=9), healthy, "intact") is not None
    assert doubted(quadruped, moved(real, "same.mcap", seed=2), healthy, "intact") is None


def test_speeds_are_those_of_commands_by_joint(quadruped: Robot):
    slow, fast = (moved(quadruped, f"{pace}.mcap", pace=pace) for pace in (1, 2))

    faster = faster_joints(problem_of(quadruped, fast, slow))

    assert set(faster) == {joint.name for joint in quadruped.anatomy.joints}
    for speed, covered in faster.values():
        assert COVERAGE * covered < speed < 2.1 * covered
        # 0.6 rad at 1 Hz, which is faster than this at most times
        assert covered < 0.6 * 2 * np.pi
    assert faster_joints(problem_of(quadruped, slow, fast)) == {}
