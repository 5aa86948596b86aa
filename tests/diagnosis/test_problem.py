"""Promises of the problem: a jam per joint with a known encoder, at the angle at which it ends."""

import numpy as np
import pytest

from selfmodel.diagnosis.problem import observed_jams
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial

KNEE = "front_left_knee"
STEPS = 90


def trial(robot: Robot, knee: np.ndarray) -> Trial:
    """A trial in which one knee has these angles, and the other joints stand at 0."""
    hinges = robot.anatomy.hinges
    angles = np.zeros((STEPS, len(hinges)))
    angles[:, hinges.index(KNEE)] = knee
    return Trial.from_arrays(robot, angles, np.zeros((STEPS, len(robot.anatomy.motors))))


def angle_of(robot: Robot, *trials: Trial) -> float | None:
    found = {jam.part: jam.severity for jam in observed_jams(trials, robot.anatomy)}
    assert found.keys() - {KNEE} == {joint.name for joint in robot.anatomy.joints} - {KNEE}
    return found.get(KNEE)


def test_a_jam_is_at_the_median_angle_of_the_last_third_of_the_last_trial(quadruped: Robot):
    moved = np.where(np.arange(STEPS) < 60, np.linspace(-0.4, 0.4, STEPS), 0.25)

    assert angle_of(quadruped, trial(quadruped, moved)) == 0.25
    earlier = trial(quadruped, np.full(STEPS, -0.3))
    assert angle_of(quadruped, earlier, trial(quadruped, moved)) == 0.25


def test_an_unknown_encoder_has_no_jam_and_an_angle_beyond_the_range_is_its_limit(
    quadruped: Robot,
):
    ((_, high),) = quadruped.anatomy.joint(KNEE).limits

    assert angle_of(quadruped, trial(quadruped, np.full(STEPS, np.nan))) is None
    beyond = trial(quadruped, np.full(STEPS, high + 0.02))
    assert angle_of(quadruped, beyond) == pytest.approx(high)


def test_without_trials_there_is_no_jam(quadruped: Robot):
    assert observed_jams([], quadruped.anatomy) == ()
