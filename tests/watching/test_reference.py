"""What healthy trials show: e-values by rank, margins by stretches, and the motions they cover."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial
from selfmodel.watching.reference import MARGINS, Reference, _margins


def reference_of(
    robot: Robot, scores: np.ndarray, margins: np.ndarray, **motion: float
) -> Reference:
    motors = len(robot.anatomy.motors)
    extent = {name: np.full(motors, value) for name, value in motion.items()}
    channels = tuple(f"channel {k}" for k in range(scores.shape[1]))
    return Reference(robot, channels, np.sort(scores, axis=0), margins, 0.1, **extent)


MOTION = {"speeds": 2.0, "lowest": -0.5, "highest": 0.5}


def test_the_e_values_of_scores_at_each_rank_have_a_mean_of_one(quadruped: Robot):
    scores = np.arange(1.0, 51.0)[:, np.newaxis]
    reference = reference_of(quadruped, scores, np.ones(1), **MOTION)
    at_each_rank = np.arange(0.6, 51.0)  # between two healthy scores, less what is allowed beyond

    e_values = np.exp([reference.log_e_values(np.array([score]))[0] for score in at_each_rank])

    assert np.mean(e_values) == pytest.approx(1.0)
    assert (np.diff(e_values) > 0).all()


def test_what_is_not_observed_is_no_evidence_and_a_diverged_simulation_is_the_most(
    quadruped: Robot,
):
    reference = reference_of(quadruped, np.ones((80, 2)), np.ones(2), **MOTION)
    unknown, diverged = reference.log_e_values(np.array([np.nan, np.inf]))

    assert unknown == 0.0
    assert diverged == pytest.approx(np.log(81 / np.sum(1 / np.arange(1, 82))))


def test_a_channel_whose_stretches_differ_has_a_larger_margin_than_one_of_independent_scores():
    rng = np.random.default_rng(2)
    levels = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 3.0])
    stretches = [np.exp(0.1 * rng.normal(size=(40, 2))) * [1.0, level] for level in levels]
    independent, differing = _margins(stretches)

    assert independent == MARGINS[0]
    assert differing > 2.0


@pytest.mark.parametrize(
    ("speed", "level", "said"),
    [
        (1.9, 0.0, ""),
        (2.6, 0.0, "rad/s, in the healthy trials at 2 rad/s at most"),
        (1.0, 0.9, "in the healthy trials from -0.5 to 0.5"),
    ],
)
def test_commands_beyond_those_of_the_healthy_trials_are_said(
    quadruped: Robot, speed: float, level: float, said: str
):
    reference = reference_of(quadruped, np.ones((80, 1)), np.ones(1), **MOTION)
    commands = np.zeros((25, 8))
    commands[:, 3] = level + speed * 0.01 * (np.arange(25) % 2)
    trial = Trial.from_arrays(quadruped, np.zeros((25, 8)), commands)
    reason = reference.uncovered(trial, 12)

    assert said in reason
    assert bool(reason) == bool(said)
    assert not said or quadruped.anatomy.motors[3] in reason
    assert not replace(reference, speeds=np.full(8, 9.0), highest=np.full(8, 2.0)).uncovered(
        trial, 12
    )
