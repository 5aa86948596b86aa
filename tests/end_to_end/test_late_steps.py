"""Promises about what a log lacks: steps that were late or lost, and encoders of lost limbs."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import dm_env
import numpy as np
import pytest

import selfmodel
from selfmodel.comparators.segment_prediction import (
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
    SegmentPrediction,
)
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import prediction_error
from selfmodel.simulation.fit import EXACT_ERROR
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS, load
from selfmodel.tasks.walking import motion_capture
from selfmodel.trials.estimation import estimated_states
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_motion
from tests.helpers.hostile import with_value, without_encoders
from tests.helpers.memory import in_memory

QUADRUPED = ROBOTS["quadruped"].robot()
NAMES = QUADRUPED.anatomy.names
STEPS, LATE = 250, (70, 71, 160)


def stuttering(silent: Collection[int] = ()) -> EnvironmentRobot:
    """A quadruped whose targets stand three times as long before some steps.

    After the steps of ``silent``, nothing is observed.
    """
    env, taken = load("quadruped", "walk"), 0
    reset, step = env.reset, env.step

    def restarted() -> dm_env.TimeStep:
        nonlocal taken
        taken = 0
        return reset()

    def stepped(action: np.ndarray) -> dm_env.TimeStep:
        nonlocal taken
        taken += 1
        for _ in range(2 if taken in LATE else 0):
            step(action)
        told = step(action)
        if taken in silent:
            raise TimeoutError
        return told

    env.reset, env.step = restarted, stepped
    return EnvironmentRobot(env, QUADRUPED, observe=motion_capture(env))


@pytest.fixture(scope="module")
def trial() -> Trial:
    """A trial of a quadruped that stutters."""
    driver = played_back(NAMES.motors, random_motion(QUADRUPED, STEPS))
    return in_memory(QUADRUPED)(stuttering(), TrialPlan("00", "after", driver, STEPS, 0))


def without_marks(trial: Trial) -> Trial:
    return replace(trial, trajectory=replace(trial.trajectory, late=None))


def test_the_marks_are_those_of_the_environment_and_a_command_before_one_is_not_steady(
    trial: Trial,
):
    trajectory = trial.trajectory
    stood_longer = np.isnan(trajectory.steady_commands).all(axis=1)
    unmarked = without_marks(trial).trajectory

    assert np.flatnonzero(trajectory.late).tolist() == list(LATE)
    assert np.flatnonzero(stood_longer).tolist() == [k - 1 for k in LATE]
    steady = trajectory.steady_commands[~stood_longer]
    np.testing.assert_array_equal(steady, trajectory["commands"][~stood_longer])
    assert unmarked.steady_commands is unmarked["commands"]
    with pytest.raises(ValueError, match=r"late must be \(steps,\) = \(250,\), got \(3,\)"):
        replace(trajectory, late=np.zeros(3, dtype=bool))


def losses(trial: Trial, comparator: SegmentPrediction, *texts: str) -> np.ndarray:
    """The loss of each hypothesis."""
    hypotheses = [parse(text, QUADRUPED.anatomy) for text in texts]
    prepared = comparator.prepare(trial)
    predicted = Simulator(QUADRUPED, 1).predict(hypotheses, prepared.request).trajectory
    return prepared.losses(predicted).total.mean(axis=1)


@pytest.mark.parametrize("comparator", [SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD])
def test_what_moves_as_the_model_says_is_predicted_although_steps_were_late(
    trial: Trial, comparator: SegmentPrediction
):
    (marked,), (unmarked,) = (
        losses(own, comparator, "intact") for own in (trial, without_marks(trial))
    )

    assert marked < unmarked
    if comparator is SEGMENT_PREDICTION:
        assert marked < 1e-20


def test_a_log_with_late_and_lost_steps_fits_the_robot_as_it_was_and_no_fault(tmp_path: Path):
    driver = played_back(NAMES.motors, random_motion(QUADRUPED, STEPS))
    plan, header = TrialPlan("00", "after", driver, STEPS, 0), TrialHeader(Settings(), timed=True)
    samples = stuttering({90}).run(driver, STEPS)
    log = read_log(write_trial(tmp_path / "trial.mcap", QUADRUPED, plan, samples, header))
    texts = ("intact", "break:front_left_knee", "jam:back_right_shoulder")

    intact, *others = losses(log.trial, SEGMENT_PREDICTION, *texts)
    assert log.timing is not None
    assert np.flatnonzero(log.timing.missing).tolist() == [90]
    assert np.flatnonzero(log.timing.late).tolist() == list(LATE)
    assert intact < 1e-12
    assert min(others) > 0.1


def test_a_model_that_is_exact_predicts_it_exactly_for_calibration_too(trial: Trial):
    assert prediction_error(QUADRUPED, [trial], 1) < EXACT_ERROR
    assert prediction_error(QUADRUPED, [without_marks(trial)], 1) > EXACT_ERROR


def test_positions_are_not_averaged_across_a_step_that_was_late(trial: Trial):
    trajectory = trial.trajectory
    noise = np.random.default_rng(0).normal(0, 3e-3, trajectory["base_position"].shape)
    noisy = {**trajectory.signals, "base_position": trajectory["base_position"] + noise}
    marked, unmarked = (
        estimated_states(replace(trajectory, signals=noisy, late=late))["base_position"]
        for late in (trajectory.late, None)
    )
    # Six steps to either side: from the sixth row before the late one to the fifth after it.
    across = np.zeros(STEPS, dtype=bool)
    for k in LATE:
        across[k - 6 : k + 6] = True

    assert not np.array_equal(marked, noisy["base_position"])
    assert np.isnan(marked[across]).all()
    np.testing.assert_allclose(marked[~across], unmarked[~across], atol=1e-12)


def test_a_trial_of_nothing_but_late_steps_is_refused(trial: Trial):
    late = replace(trial, trajectory=replace(trial.trajectory, late=np.ones(STEPS, dtype=bool)))
    with pytest.raises(InputError, match="needs 4 or more segments of 12 steps in which none was"):
        SEGMENT_PREDICTION.prepare(late)


def lost(
    robot: Robot, truth: str, hinges: tuple[str, ...], steps: slice, length: int = 500
) -> Trial:
    """A trial of a robot in which the encoders of some hinges measure nothing at some steps."""
    physical = selfmodel.simulated_robot(robot, truth, gap=0.05, seed=3)
    gait = random_controllers(robot, 1, seed=5)[0]
    trial = in_memory(robot)(physical, TrialPlan("after", "after", gait, length, seed=0))
    columns = [robot.anatomy.hinges.index(hinge) for hinge in hinges]
    trial = without_encoders(trial, columns, steps)
    trial = with_value(trial, "joint_efforts", steps, columns, np.nan)
    sensors = enumerate(robot.anatomy.sensors)
    angles = [k for k, one in sensors if one.kind == "angle" and one.hinge in hinges]
    return with_value(trial, "sensors", steps, angles, np.nan)


def diagnosis(trial: Trial, robot: Robot, comparator: str, kinds: str) -> selfmodel.Diagnosis:
    small = selfmodel.Settings(generations=2).scaled(8)
    options = {"settings": small, "comparator": comparator, "kinds": kinds}
    return selfmodel.diagnose(trial, robot=robot, seed=0, threads=1, **options)


@pytest.mark.search
@pytest.mark.parametrize(
    ("truth", "hinges", "first"),
    [
        ("break:front_left_shoulder", ("front_left_shoulder", "front_left_knee"), 0),
        ("jam:back_right_shoulder", ("front_left_knee",), 200),
    ],
)
def test_a_fault_is_found_without_the_encoders_of_a_limb(
    truth: str, hinges: tuple[str, ...], first: int, quadruped: Robot
):
    trial = lost(quadruped, truth, hinges, slice(first, None))
    assert str(diagnosis(trial, quadruped, "segment-prediction", "paper").best) == truth


@pytest.mark.search
@pytest.mark.parametrize(
    "comparator", ["segment-prediction-onboard", "gait-pattern", "noisy-transfer"]
)
def test_every_comparator_of_joints_judges_a_trial_without_an_encoder(
    comparator: str, quadruped: Robot
):
    trial = lost(quadruped, "break:front_left_knee", ("front_left_knee",), slice(None), 120)
    found = diagnosis(trial, quadruped, comparator, "break")
    assert np.isfinite(found.ranked[0].distance)
    assert found.ranked[0].distance < found.intact_distance
