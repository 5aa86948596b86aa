"""Promises about robots that feel nothing: their controllers are rhythms, and they move."""

from pathlib import Path

import numpy as np

from selfmodel.behaviour import collect
from selfmodel.hypothesis import INTACT
from selfmodel.mjcf import MjcfSettings
from selfmodel.oscillators import Oscillators
from selfmodel.physical import SimulatedRobot
from selfmodel.robot import Robot
from selfmodel.simulator import Simulator
from tests.mjcf.awkward import mjcf


def test_a_robot_without_any_sensor_moves_as_a_physical_and_as_a_simulated_one(tmp_path: Path):
    (tmp_path / "robot.xml").write_text(mjcf(), encoding="utf-8")
    robot = Robot.from_mjcf(tmp_path / "robot.xml", MjcfSettings(touch=(), angle=()))
    driver = Oscillators(robot.cpg, np.full(robot.cpg.weights, 0.5))
    simulated = Simulator(robot, 1).run([(INTACT, driver)], 20, ["joint_positions"]).behaviour
    physical = collect(robot.anatomy.names, SimulatedRobot(robot).run(driver, 20))

    assert robot.anatomy.sensors == ()
    np.testing.assert_array_equal(simulated["joint_positions"][0], physical["joint_positions"])
    assert np.ptp(physical["joint_positions"]) > 0
