"""T-Resilience: it learns from its trials what does not transfer."""

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.t_resilience import _objectives, _Population, t_resilience
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


def test_gaits_are_selected_for_displacement_transferability_and_diversity():
    genomes = np.array([[0.0, 0.0], [0.0, 0.0], [0.6, 0.8]])
    members = _Population(genomes, np.array([1.0, 2.0, 3.0]), np.zeros((3, 4)))
    objectives = _objectives(members, np.array([0.5, 0.0, 0.25]))

    assert objectives[:, 0].tolist() == [1, 2, 3]
    assert objectives[:, 1].tolist() == [-0.5, 0, -0.25]
    assert np.allclose(objectives[:, 2], [1 / 3, 1 / 3, 2 / 3])
