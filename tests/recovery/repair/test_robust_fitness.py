"""Promises of the fitness under random conditions."""

import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.repair.robust_fitness import RobustFitness, robust
from selfmodel.recovery.scores.fitness import DISPLACEMENT, Score
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import unstable


def test_the_mean_and_the_lower_tail_count_alike():
    scores = np.array([[0.0, 10.0, 10.0, 10.0], [7.0, 7.0, 7.0, 7.0], [4.0, 4.0, 4.0, 8.0]])
    np.testing.assert_allclose(robust(scores), [(7.5 + 0) / 2, 7, (5 + 4) / 2])
    np.testing.assert_allclose(robust(np.array([[3.0]])), [3.0])


def test_scores_are_those_of_each_condition(quadruped: Robot):
    fitness = RobustFitness(
        Simulator(quadruped, 1), DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped)
    )
    drivers = random_controllers(quadruped, 3)
    scores = fitness(drivers, 4, 50, np.random.default_rng(0))

    assert scores.shape == (3, 4)
    assert len(np.unique(scores)) == 12
    np.testing.assert_array_equal(
        fitness(drivers[1:2], 4, 50, np.random.default_rng(0)), scores[1:2]
    )


def test_a_simulation_that_diverges_scores_minus_infinity(quadruped: Robot):
    fitness = RobustFitness(
        Simulator(unstable(quadruped), 1), DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped)
    )
    scores = fitness(random_controllers(quadruped, 2), 2, 50, np.random.default_rng(0))

    assert np.isneginf(scores).all()
    assert np.isneginf(robust(scores)).all()


def test_a_race_has_the_full_scores_of_the_leaders_at_two_thirds_of_the_cost(quadruped: Robot):
    simulator, steps = Simulator(quadruped, 2), 100
    fitness = RobustFitness(simulator, DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped))
    drivers = random_controllers(quadruped, 24)
    whole = fitness(drivers, 1, steps, np.random.default_rng(0))[:, 0]
    before = simulator.stats.steps
    raced = fitness.race(drivers, 2, steps, np.random.default_rng(0))

    assert (simulator.stats.steps - before) / (24 * steps) == pytest.approx(0.7, abs=0.02)
    assert (raced == whole).sum() == 12
    for group in (slice(0, 12), slice(12, 24)):  # the leader of each group goes on to the end
        leader = np.argmax(whole[group])
        assert raced[group][leader] == whole[group][leader]
        assert (raced[group] == whole[group]).sum() == 6


@pytest.mark.parametrize("grows", [True, False])
def test_a_controller_that_is_stopped_is_below_those_that_went_on_or_may_still_grow(
    quadruped: Robot, *, grows: bool
):
    slope = 1 if grows else -1

    def count(_robot: Robot, _hypothesis: object, behaviour: Behaviour) -> np.ndarray:
        return np.arange(24.0) % 12 + slope * behaviour.steps

    simulator, steps = Simulator(quadruped, 1), 100
    score = Score("count", ("base_position",), count, grows_with_time=grows)
    fitness = RobustFitness(simulator, score, (INTACT,), assumed_uncertainty(quadruped))
    raced = fitness.race(random_controllers(quadruped, 24), 2, steps, np.random.default_rng(0))

    for group in (raced[:12], raced[12:]):
        np.testing.assert_array_equal(group[6:], np.arange(6, 12) + slope * steps)
        if grows:  # the scores up to then
            np.testing.assert_array_equal(group[:6], np.arange(6) + np.repeat([30, 60], [4, 2]))
        else:
            assert (group[4:6] < group[6]).all()
            assert (group[:4] < group[4:6].min()).all()


def test_one_diverged_rollout_does_not_reject_a_controller():
    some, none = [5.0, 5.0, 5.0, -np.inf], [-np.inf] * 4
    assert np.argsort(-robust(np.array([none, some]))).tolist() == [1, 0]
    assert np.isfinite(robust(np.array([some]))).all()
