"""Promises of the evidence against a fault: a sensor whose reading changes has not failed."""

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.losses import contradiction_losses
from selfmodel.diagnosis.significance import CONTRADICTION
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, collect
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed

STEPS, SENSOR = 120, "front_left_touch"
PIECES = np.array([[0, 12], [12, 24], [60, 72], [107, 119]])


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 2)[1]


def behaviour_of(robot: Robot, gait: Controller, truth: str) -> Behaviour:
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    samples = list(physical.run(gait, STEPS))
    return collect(robot.anatomy.names, samples)


def with_readings(run: Behaviour, steps: list[int], reading: float) -> Behaviour:
    """The behaviour with a sensor that reads 0 except at some steps."""
    sensors = run["sensors"].copy()
    column = run.names.sensors.index(SENSOR)
    sensors[:, column] = 0.0
    sensors[steps, column] = reading
    return changed(run, sensors=sensors)


def test_a_reading_contradicts_the_failed_sensor_in_every_piece_with_its_step(
    quadruped: Robot, gait: Controller
):
    run = with_readings(behaviour_of(quadruped, gait, "intact"), [12, 65], 1.0)
    failed = parse(f"sensor:{SENSOR}+break:back_left_knee", quadruped.anatomy)

    losses = contradiction_losses([INTACT, failed], run, PIECES)

    assert losses.tolist() == [[0, 0, 0, 0], [CONTRADICTION, CONTRADICTION, CONTRADICTION, 0]]


def test_the_log_of_a_failed_sensor_does_not_contradict_it(quadruped: Robot, gait: Controller):
    truth = f"sensor:{SENSOR}"
    run = behaviour_of(quadruped, gait, truth)

    assert not contradiction_losses([parse(truth, quadruped.anatomy)], run, PIECES).any()


def test_an_unknown_reading_contradicts_nothing(quadruped: Robot, gait: Controller):
    run = with_readings(behaviour_of(quadruped, gait, "intact"), [12, 65], np.nan)
    failed = parse(f"sensor:{SENSOR}", quadruped.anatomy)

    assert not contradiction_losses([failed], run, PIECES).any()


@pytest.mark.parametrize(
    ("fault", "contradicted"),
    [("gain0.2", [True, True, True, False]), ("bias0.3", [True, True, True, True])],
)
def test_readings_of_0_and_1_contradict_a_gain_and_a_bias(
    quadruped: Robot, gait: Controller, fault: str, contradicted: list[bool]
):
    run = with_readings(behaviour_of(quadruped, gait, "intact"), [12, 65], 1.0)
    hypothesis = parse(f"sensor:{SENSOR}={fault}", quadruped.anatomy)

    found = contradiction_losses([hypothesis], run, PIECES)[0] > 0
    assert found.tolist() == contradicted


@pytest.mark.parametrize("fault", ["gain0.2", "bias0.3"])
def test_the_log_of_a_gain_or_a_bias_does_not_contradict_it(
    quadruped: Robot, gait: Controller, fault: str
):
    truth = f"sensor:{SENSOR}={fault}"
    run = behaviour_of(quadruped, gait, truth)

    assert not contradiction_losses([parse(truth, quadruped.anatomy)], run, PIECES).any()
