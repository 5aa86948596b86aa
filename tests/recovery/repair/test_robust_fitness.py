"""Promises of the fitness under random conditions."""

import numpy as np

from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.repair.robust_fitness import RobustFitness, robust
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
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


def test_one_diverged_rollout_does_not_reject_a_controller():
    some, none = [5.0, 5.0, 5.0, -np.inf], [-np.inf] * 4
    assert np.argsort(-robust(np.array([none, some]))).tolist() == [1, 0]
    assert np.isfinite(robust(np.array([some]))).all()
