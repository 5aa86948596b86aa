"""Displacement and falls of physical runs."""

import pytest

from selfmodel.errors import TrialError
from selfmodel.recovery.baselines.measurement import Measured, Track, measure
from selfmodel.robot.robot import Robot
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.stub_robot import StubRobot
from tests.recovery.baselines.problems import LEVEL


def measured(robot: Robot, **given: int) -> Measured:
    (controller,) = random_controllers(robot, 1)
    return measure(Track(StubRobot(robot, lambda _: 1.0, **given), robot, LEVEL, 11), controller)


def test_a_run_without_a_fall_has_its_whole_displacement(quadruped: Robot):
    assert measured(quadruped) == Measured(pytest.approx(1), pytest.approx(1), False, 11)


def test_what_follows_a_fall_does_not_count_as_upright(quadruped: Robot):
    found = measured(quadruped, falls_after=5)

    assert found == Measured(pytest.approx(1), pytest.approx(0.4), True, 11)


def test_a_run_that_ends_early_counts_as_far_as_it_went(quadruped: Robot):
    assert measured(quadruped, ends_after=6) == Measured(
        pytest.approx(0.5), pytest.approx(0.5), False, 6
    )


def test_a_run_that_is_stopped_as_the_robot_falls_has_a_fall(quadruped: Robot):
    found = measured(quadruped, falls_after=5, ends_after=6)

    assert found == Measured(pytest.approx(0.5), pytest.approx(0.4), True, 6)


def test_a_run_without_any_sample_is_an_error(quadruped: Robot):
    with pytest.raises(TrialError, match="the robot failed"):
        measured(quadruped, ends_after=0)
