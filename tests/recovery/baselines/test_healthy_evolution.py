"""NoisyEa of new gaits for the healthy robot."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.recovery.baselines.healthy_evolution import healthy_evolution
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.robot.robot import Robot
from tests.recovery.baselines.problems import first_weight, problem_of


def test_distinct_controllers_are_tried_in_the_order_of_their_simulated_fitness(quadruped: Robot):
    known: list[Controller] = []

    def healthy(controllers: Sequence[Controller]) -> FloatArray:
        known.extend(controllers)
        return np.array([first_weight(one) for one in controllers])

    problem = problem_of(quadruped, lambda _: 0.3, healthy=healthy)
    settings = BaselineSettings(trials=4, evaluations=20)
    trials = healthy_evolution(problem, settings, np.random.default_rng(0), lambda _: None)
    best = sorted(set(known), key=first_weight, reverse=True)[:4]

    assert len({trial.controller for trial in trials}) == 4
    assert [first_weight(trial.controller) for trial in trials] == [*map(first_weight, best)]
