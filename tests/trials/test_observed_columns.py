"""Promises of observed columns: a reference lacks what the trials to explain lack, and no more."""

import numpy as np

from selfmodel.robot.robot import Robot
from selfmodel.trials.observed_columns import observed_as
from selfmodel.trials.trial import Trial


def trial(robot: Robot, *unknown: int) -> Trial:
    """A trial in which the encoders of some hinges are never known."""
    angles = np.zeros((20, len(robot.anatomy.hinges)))
    angles[:, list(unknown)] = np.nan
    return Trial.from_arrays(robot, angles, np.zeros((20, len(robot.anatomy.motors))))


def test_a_lost_encoder_is_left_out_of_the_reference(quadruped: Robot):
    healthy = trial(quadruped)
    found = observed_as(healthy, [trial(quadruped, 2)])

    known = np.isfinite(found.behaviour["joint_positions"]).all(axis=0)
    assert np.flatnonzero(~known).tolist() == [2]
    assert np.isfinite(healthy.behaviour["joint_positions"]).all()


def test_an_encoder_that_one_of_the_trials_lacks_is_left_out(quadruped: Robot):
    found = observed_as(trial(quadruped), [trial(quadruped), trial(quadruped, 1)])

    assert np.isnan(found.behaviour["joint_positions"][:, 1]).all()


def test_a_reference_for_complete_trials_is_the_trial_itself(quadruped: Robot):
    healthy = trial(quadruped, 3)

    assert observed_as(healthy, [trial(quadruped, 3)]) is healthy
    assert observed_as(healthy, []) is healthy
