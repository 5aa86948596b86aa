"""What healthy trials show: e-values by rank, margins by stretches, and the motions they cover."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial
from selfmodel.watching.reference import MARGINS, SMALLEST_P, Reference, _log_e_values, _margins


def reference_of(
    robot: Robot, scores: np.ndarray, margins: np.ndarray, **motion: float
) -> Reference:
    motors = len(robot.anatomy.motors)
    extent = {name: np.full(motors, value) for name, value in motion.items()}
    channels = tuple(f"channel {k}" for k in range(scores.shape[1]))
    return Reference(robot, channels, np.sort(scores, axis=0), margins, 0.1, **extent)


MOTION = {"speeds": 2.0, "lowest": -0.5, "highest": 0.5}


LARGEST = -np.log(SMALLEST_P) - np.log(1.0 - np.log(SMALLEST_P))
"""Logarithm of the largest e-value."""


@pytest.mark.parametrize("index", [1.0, 3.0])
@pytest.mark.parametrize("held_out", [50, 600])
def test_the_e_values_of_healthy_scores_with_a_tail_have_a_mean_of_at_most_one(
    index: float, held_out: int
):
    rng, means = np.random.default_rng(4), []
    for _ in range(400):  # on average over healthy trials
        healthy = np.sort(rng.pareto(index, held_out) + 1)
        means.append(np.exp(_log_e_values(rng.pareto(index, 4000) + 1, healthy)).mean())

    assert 0.8 < np.mean(means) < 1.05


def test_larger_scores_are_more_evidence_also_beyond_those_of_the_healthy_trials(quadruped: Robot):
    reference = reference_of(quadruped, np.arange(1.0, 51.0)[:, None], np.ones(1), **MOTION)
    logs = [reference.log_e_values(np.array([score]))[0] for score in np.arange(0.6, 70.0)]

    assert (np.diff(logs) >= 0).all()
    assert logs[49] < logs[-1] < LARGEST


def test_what_is_not_observed_is_no_evidence_and_a_diverged_simulation_is_the_most(
    quadruped: Robot,
):
    scores = np.linspace(1.0, 2.0, 80)[:, np.newaxis] * [1.0, 1.0]
    reference = reference_of(quadruped, scores, np.ones(2), **MOTION)
    unknown, diverged = reference.log_e_values(np.array([np.nan, np.inf]))

    assert unknown == 0.0
    assert diverged == pytest.approx(LARGEST)


def test_scores_that_are_infinite_in_the_healthy_trials_are_evidence_by_their_rank(
    quadruped: Robot,
):
    scores = np.append(np.linspace(1.0, 2.0, 78), [np.inf, np.inf])[:, np.newaxis]
    (log,) = reference_of(quadruped, scores, np.ones(1), **MOTION).log_e_values(np.array([np.inf]))

    assert log == pytest.approx(np.log(81 / 3) - np.log(1.0 - np.log(SMALLEST_P)))


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
