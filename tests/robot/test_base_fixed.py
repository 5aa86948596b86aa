"""Tests of a fixed base: its signals are constants of the model, and no part of the state."""

import mujoco
import numpy as np
import pytest

from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import bind_data, current_value, signal_fields, state_writer
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import collect
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_cpgs
from tests.helpers.robots.arms import arm, arm_mjcf, quadruped_on_a_stand, robot_of

POSE = ("base_position", "base_orientation")
VELOCITY = ("base_linear_velocity", "base_angular_velocity")
"""Names of the signals of a base."""


def driver_of(robot: Robot) -> Controller:
    (driver,) = random_cpgs(robot, 1)
    return driver


def nested() -> Robot:
    """An arm on two static bodies, both displaced and turned."""
    outer = '<body name="table" pos="1 2 .5" euler="0 0 1.5707963267948966">{}</body>'
    inner = '<body name="foot" pos=".1 0 .2" euler="0.3 0 0">{arm}</body>'
    return robot_of(arm_mjcf(outer.format(inner)))


def test_the_root_is_the_static_body_nearest_to_the_driven_joints():
    assert nested().root == "foot"
    assert nested().has_fixed_base


def test_the_pose_of_the_base_is_that_of_its_body_and_its_velocities_are_zero():
    robot = nested()
    data = mujoco.MjData(robot.model)
    data.qpos[:], data.qvel[:] = 0.5, 1.0
    mujoco.mj_forward(robot.model, data)
    found = {name: current_value(field, data) for name, field in signal_fields(robot).items()}
    np.testing.assert_allclose(found["base_position"], data.body("foot").xpos, atol=1e-12)
    np.testing.assert_allclose(found["base_orientation"], data.body("foot").xquat, atol=1e-12)
    assert not any(found[signal].any() for signal in VELOCITY)
    assert robot.standing_height == pytest.approx(0.7)


def test_a_logged_base_leaves_the_state_unchanged():
    robot = arm()
    data = mujoco.MjData(robot.model)
    state_writer(robot, bind_data(data))({"base_position": np.ones((1, 3))})
    assert not data.qpos.any()


def test_a_physical_robot_without_a_gap_is_simulated_to_the_bit():
    for robot in (arm(), quadruped_on_a_stand()):
        driver = driver_of(robot)
        hidden = parse(f"motor:{robot.anatomy.joints[1].name}=0.4", robot.anatomy)
        logged = collect(robot.anatomy.names, SimulatedRobot(robot, hidden).run(driver, 60))
        simulated = Simulator(robot, 1).run([(hidden, driver)], 60, SIGNALS).behaviour
        for signal in SIGNALS:
            assert np.array_equal(logged[signal], simulated[signal][0]), signal


def test_the_base_of_a_physical_robot_with_a_gap_has_no_measurement_noise():
    robot = quadruped_on_a_stand()
    gap = draw_gap(robot, 0.05, np.random.default_rng(1))
    samples = SimulatedRobot(robot, INTACT, gap).run(driver_of(robot), 20)
    logged = collect(robot.anatomy.names, samples)
    for signal in (*POSE, *VELOCITY):
        assert np.ptp(logged[signal], axis=0).max() == 0


def test_a_broken_limb_of_a_robot_on_a_stand_falls_as_debris():
    robot = quadruped_on_a_stand()
    gap = draw_gap(robot, 0.05, np.random.default_rng(1))
    hidden = parse("break:front_left_knee", robot.anatomy)
    samples = list(SimulatedRobot(robot, hidden, gap).run(driver_of(robot), 20))
    assert all(np.isfinite(row).all() for row in samples[-1].values.values())


def test_a_slope_tilts_a_fixed_base():
    robot = arm()
    hypothesis = parse("slope=0.2", robot.anatomy)
    runs = [(INTACT, driver_of(robot)), (hypothesis, driver_of(robot))]
    behaviour = Simulator(robot, 1).run(runs, 5, SIGNALS).behaviour
    level, tilted = behaviour["base_orientation"][:, -1]
    assert 2 * np.arccos(level @ tilted) == pytest.approx(0.2)
    assert not np.array_equal(*behaviour["joint_positions"])


@pytest.mark.parametrize("notation", ["friction=0.2", "wind=0"])
def test_the_ground_does_nothing_to_an_arm_without_contacts(notation: str):
    robot = arm()
    runs = [(INTACT, driver_of(robot)), (parse(notation, robot.anatomy), driver_of(robot))]
    behaviour = Simulator(robot, 1).run(runs, 30, SIGNALS).behaviour
    assert np.array_equal(*behaviour["joint_positions"])
