"""Evolution on the physical robot."""

import numpy as np

from selfmodel.recovery.baselines.physical_evolution import physical_evolution
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.robot.robot import Robot
from tests.recovery.baselines.problems import first_weight, problem_of


def test_evolution_improves_with_the_trials_and_spends_all_of_them(quadruped: Robot):
    settings = BaselineSettings(trials=203, population=20)
    trials = physical_evolution(
        problem_of(quadruped), settings, np.random.default_rng(0), lambda _: None
    )
    tried = [first_weight(trial.controller) for trial in trials]

    assert len(trials) == 203
    assert np.mean(tried[-40:]) > np.mean(tried[:20]) + 0.5
