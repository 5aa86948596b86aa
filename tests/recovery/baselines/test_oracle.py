"""The oracle: the best controller of several searches on the hidden model."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.recovery.baselines.oracle import oracle
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.robot.robot import Robot
from tests.recovery.baselines.problems import first_weight, problem_of

SETTINGS = BaselineSettings(trials=3, evaluations=40, searches=2)


def test_all_trials_have_the_best_controller_of_all_searches(quadruped: Robot):
    known: list[Controller] = []

    def hidden(controllers: Sequence[Controller]) -> FloatArray:
        known.extend(controllers)
        return np.array([first_weight(one) for one in controllers])

    problem = problem_of(quadruped, hidden=hidden)
    trials = oracle(problem, SETTINGS, np.random.default_rng(0), lambda _: None)

    assert len(trials) == 3
    assert {trial.controller for trial in trials} == {max(known, key=first_weight)}


def test_one_lucky_evaluation_does_not_decide(quadruped: Robot):
    evaluated: list[Controller] = []

    def hidden(controllers: Sequence[Controller]) -> FloatArray:
        lucky = 0 if evaluated else 10
        evaluated.extend(controllers)
        return (
            np.array([first_weight(one) for one in controllers])
            + lucky * np.eye(len(controllers))[0]
        )

    problem = problem_of(quadruped, hidden=hidden)
    trials = oracle(problem, SETTINGS, np.random.default_rng(0), lambda _: None)

    assert trials[0].controller != evaluated[0]
    assert first_weight(trials[0].controller) > first_weight(evaluated[0])
