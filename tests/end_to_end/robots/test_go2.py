"""A real robot's log: the calibrated model predicts what it was not fitted to, and says intact."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.go2.recording import (
    FITTED,
    better_hypotheses,
    positions_and_commands,
    robot_of,
    robot_on_stand,
    simulated,
)
from selfmodel.robot.robot import Robot
from tests.helpers.go2 import recorded

NUMBERS = Path(__file__).parents[3] / "benchmarks" / "go2" / "go2.json"

pytestmark = recorded


@pytest.fixture(scope="module")
def fitted() -> Robot:
    found = json.loads(NUMBERS.read_text())
    return robot_of(robot_on_stand(), found["fit"])


def error(robot: Robot) -> float:
    positions, commands = positions_and_commands(robot)
    errors = (simulated(robot, positions, commands) - positions)[FITTED:]
    return float(np.sqrt(np.mean(errors**2)))


def test_the_last_five_seconds_are_predicted_better_by_a_quarter(fitted: Robot):
    assert error(fitted) < 0.75 * error(robot_on_stand())


@pytest.mark.search
def test_no_weak_motor_explains_the_healthy_robot_better(fitted: Robot):
    found = better_hypotheses(fitted, 1)

    assert (found["smaller loss"], found["significantly better"]) == (0, 0)
