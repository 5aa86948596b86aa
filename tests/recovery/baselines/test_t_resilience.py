"""T-Resilience: it learns from its trials what does not transfer."""

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.t_resilience import t_resilience
from selfmodel.robot.robot import Robot
from tests.recovery.baselines.problems import first_weight, problem_of

SETTINGS = BaselineSettings(trials=12, population=40, period=3)


def on_the_second_foot(controller: Controller) -> bool:
    return bool(controller.genome[1] > 0)


def test_the_last_trial_avoids_what_did_not_transfer(quadruped: Robot):
    problem = problem_of(
        quadruped, lambda one: 0.0 if on_the_second_foot(one) else first_weight(one)
    )
    trials = t_resilience(problem, SETTINGS, np.random.default_rng(0), lambda _: None)

    assert len(trials) == 12
    assert any(on_the_second_foot(trial.controller) for trial in trials[:-1])
    assert not on_the_second_foot(trials[-1].controller)
    assert trials[-1].measured.upright > 1.5
