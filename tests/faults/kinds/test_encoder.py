"""Tests of encoders with an offset."""

import numpy as np
import pytest

from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import cut_segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour, collect
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_motion

STEPS = 60
OFFSET = 0.1
JOINT = "front_left_shoulder"
STATES = tuple(
    signal for signal in SIGNALS if signal not in ("sensors", "commands", "joint_efforts")
)


def simulated(robot: Robot, texts: list[str]) -> Behaviour:
    """The behaviours of hypotheses under given commands."""
    driver = Playback(robot.anatomy.motors, random_motion(robot, STEPS))
    runs = [(parse(text, robot.anatomy), driver) for text in texts]
    return Simulator(robot, 1).run(runs, STEPS, SIGNALS).behaviour


def shift(robot: Robot) -> np.ndarray:
    return OFFSET * (np.array(robot.anatomy.hinges) == JOINT)


def test_an_offset_shifts_the_encoder_and_its_sensor_and_nothing_else(quadruped: Robot):
    run = simulated(quadruped, ["intact", f"encoder-offset:{JOINT}={OFFSET}"])
    sensor = [each.hinge for each in quadruped.anatomy.sensors].index(JOINT)
    reading = OFFSET / quadruped.anatomy.sensors[sensor].half_range

    np.testing.assert_array_equal(
        run["joint_positions"][1], run["joint_positions"][0] + shift(quadruped)
    )
    readings = run["sensors"][1] - run["sensors"][0]
    np.testing.assert_allclose(readings[:, sensor], reading, atol=1e-12)
    np.testing.assert_array_equal(np.delete(readings, sensor, axis=1), 0)
    for signal in set(SIGNALS) - {"joint_positions", "sensors"}:
        np.testing.assert_array_equal(run[signal][1], run[signal][0])


def test_a_prediction_begins_at_the_true_angle(quadruped: Robot):
    text = f"encoder-offset:{JOINT}={OFFSET}"
    run = simulated(quadruped, [text])
    logged = Behaviour(run.names, run.time, {signal: run[signal][0] for signal in SIGNALS})
    starts = np.array([0, 20, 40])
    segments = cut_segments(logged, {s: logged[s] for s in STATES}, starts, 10, STATES)
    hypotheses = [INTACT, parse(text, quadruped.anatomy)]
    predicted = Simulator(quadruped, 1).predict(hypotheses, segments).behaviour

    for signal in STATES:
        expected = np.stack([logged[signal][start : start + 11] for start in starts])
        np.testing.assert_allclose(predicted[signal][1], expected, atol=1e-5, err_msg=signal)
    wrong = predicted["base_position"][0, :, -1] - predicted["base_position"][1, :, -1]
    assert np.abs(wrong).max() > 1e-4


@pytest.mark.parametrize("other", ["", f"+jam:{JOINT}=0.2", "+sensor:front_left_angle"])
def test_a_physical_robot_logs_what_a_simulation_logs(quadruped: Robot, other: str):
    text = f"encoder-offset:{JOINT}={OFFSET}{other}"
    run = simulated(quadruped, [text])
    driver = Playback(quadruped.anatomy.motors, random_motion(quadruped, STEPS))
    physical = SimulatedRobot(quadruped, parse(text, quadruped.anatomy)).run(driver, STEPS)
    logged = collect(quadruped.anatomy.names, physical)

    for signal in SIGNALS:
        np.testing.assert_array_equal(logged[signal], run[signal][0])


def test_the_sensor_of_a_jammed_joint_measures_the_angle_with_the_offset(quadruped: Robot):
    run = simulated(quadruped, [f"encoder-offset:{JOINT}={OFFSET}+jam:{JOINT}=0.2"])
    sensor = quadruped.anatomy.sensor("front_left_angle")
    column = quadruped.anatomy.sensors.index(sensor)

    assert run["sensors"][0, :, column] == pytest.approx(sensor.reading(0.2 + OFFSET))


def test_a_broken_joint_has_no_encoder(quadruped: Robot):
    both = parse(f"break:{JOINT}+encoder-offset:front_left_knee=0.1", quadruped.anatomy)

    assert str(both) == f"break:{JOINT}"
