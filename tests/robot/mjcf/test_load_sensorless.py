"""Tests of robots without sensors: with a CPG they move and are logged."""

from pathlib import Path

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import TrialPlan
from tests.robot.mjcf.awkward import mjcf


def test_a_robot_without_any_sensor_moves_as_a_physical_and_as_a_simulated_one(tmp_path: Path):
    (tmp_path / "robot.xml").write_text(mjcf(), encoding="utf-8")
    robot = load_mjcf(tmp_path / "robot.xml", MjcfSettings(touch=(), angle=()))
    driver = Controller(cpg_for(robot), np.full(cpg_for(robot).weights, 0.5))
    simulated = Simulator(robot, 1).run([(INTACT, driver)], 20, ["joint_positions"]).behaviour
    physical = collect(robot.anatomy.names, SimulatedRobot(robot).run(driver, 20))

    assert robot.anatomy.sensors == ()
    np.testing.assert_array_equal(simulated["joint_positions"][0], physical["joint_positions"])
    assert np.ptp(physical["joint_positions"]) > 0


def test_a_trial_of_a_robot_without_any_sensor_is_logged_and_read(tmp_path: Path):
    (tmp_path / "robot.xml").write_text(mjcf(), encoding="utf-8")
    robot = load_mjcf(tmp_path / "robot.xml", MjcfSettings(touch=(), angle=()))
    driver = Controller(cpg_for(robot), np.full(cpg_for(robot).weights, 0.5))
    path = write_trial(
        tmp_path / "trial.mcap",
        robot,
        TrialPlan("trial", "single", driver, 20, 0),
        SimulatedRobot(robot).run(driver, 20),
        TrialHeader(Settings()),
    )
    read = read_log(path).trial.behaviour

    assert read["sensors"].shape == (20, 0)
    assert read["joint_positions"].shape == (20, robot.model.nu)
