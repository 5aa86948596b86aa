"""The physical trials of a baseline."""

import pytest

from selfmodel.recovery.baselines.problem import BaselineSettings, PhysicalTrials
from selfmodel.robot.robot import Robot
from tests.helpers.drivers import random_controllers
from tests.recovery.baselines.problems import first_weight, problem_of


def test_no_more_trials_are_run_than_there_are(quadruped: Robot):
    trials = PhysicalTrials(problem_of(quadruped), BaselineSettings(trials=2), lambda _: None)
    one, two = random_controllers(quadruped, 2)

    assert trials.left == 2
    assert trials.run(one) == pytest.approx(first_weight(one))
    assert trials.run(two) == pytest.approx(first_weight(two))
    assert trials.left == 0
    with pytest.raises(ValueError, match="all 2 physical trials are spent"):
        trials.run(one)
    assert trials.done[1].best == pytest.approx(max(first_weight(one), first_weight(two)))
