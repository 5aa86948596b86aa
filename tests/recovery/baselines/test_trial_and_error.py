"""IT&E: which gaits it tries, and when it ends."""

import dataclasses

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.trial_and_error import trial_and_error
from selfmodel.robot.robot import Robot
from tests.recovery.baselines.problems import first_weight, problem_of, repertoire_of

SETTINGS = BaselineSettings(trials=6)
NEIGHBOURS = [1.5, 1.4, 0.9], [[0.2] * 4, [0.25] * 4, [0.9] * 4]


def tried(problem, settings: BaselineSettings = SETTINGS) -> list[float]:  # noqa: ANN001
    """Displacement in the repertoire of each gait that was tried."""
    trials = trial_and_error(problem, settings, np.random.default_rng(0), lambda _: None)
    return [pytest.approx(first_weight(trial.controller)) for trial in trials]


def test_one_trial_is_enough_if_the_best_gait_keeps_its_speed(quadruped: Robot):
    assert tried(problem_of(quadruped)) == [1.5]


def test_a_failed_gait_lowers_the_prediction_of_its_neighbours(quadruped: Robot):
    problem = problem_of(
        quadruped,
        lambda one: 0.0 if first_weight(one) > 1.2 else 0.85,
        repertoire=repertoire_of(quadruped, *NEIGHBOURS),
    )

    assert tried(problem) == [1.5, 0.9]


def test_gaits_that_are_unlike_are_predicted_independently(quadruped: Robot):
    problem = problem_of(
        quadruped,
        lambda one: 0.0 if first_weight(one) > 1.45 else 1.4,
        repertoire=repertoire_of(
            quadruped, NEIGHBOURS[0], [[0.0] * 4, [1.0] * 4, [0.0, 1.0, 0.0, 1.0]]
        ),
    )

    assert tried(problem) == [1.5, 1.4]


def test_the_trials_end_with_their_number(quadruped: Robot):
    problem = problem_of(quadruped, lambda _: 0.0)

    assert len(tried(problem, dataclasses.replace(SETTINGS, trials=2))) == 2


def test_without_a_repertoire_the_error_names_the_remedy(quadruped: Robot):
    with pytest.raises(InputError, match="make one with `selfmodel repertoire make`"):
        tried(problem_of(quadruped, repertoire=None))
