"""The hexapod of benchmarks/hexapod: its URDF, in MuJoCo and in PyBullet, and its tables."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is in the dependency group other-engine")

from benchmarks.hexapod.robots import CASES, LEGS, MODELS, STEPS, VELOCITY, retracted, self_model
from benchmarks.hexapod.tables import table
from benchmarks.hexapod.trials import HexapodEnvironment
from benchmarks.other_engine.environment import physical_robot
from selfmodel.controllers.playback import Playback
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory, collect


@pytest.fixture(scope="module")
def robot() -> Robot:
    return self_model("import")


def tripod(robot: Robot, legs: str = "intact", steps: int = STEPS // 4) -> Trajectory:
    """A walk in which three legs swing forward while the others push."""
    motors, phase = robot.anatomy.motors, 3 * np.pi * robot.control_timestep * np.arange(steps)
    commands = np.zeros((steps, len(motors)))
    for column, motor in enumerate(motors):
        own = phase + np.pi * motor.startswith(("front_left", "back_left", "middle_right"))
        if motor.endswith("coxa"):
            commands[:, column] = 0.4 * np.sin(own)
        elif motor.endswith("femur"):
            commands[:, column] = -0.5 * np.maximum(0, np.cos(own))
    with HexapodEnvironment(robot, 0, legs, gain=0.1) as environment:
        samples = physical_robot(environment, robot).run(Playback(motors, commands), steps)
        return collect(robot.anatomy.names, samples)


def test_the_hexapod_has_18_servos_that_hold_its_weight(robot: Robot):
    data = mujoco.MjData(robot.model)
    mujoco.mj_step(robot.model, data, 500)

    assert len(robot.anatomy.motors) == 18
    assert 2.2 <= robot.model.body_mass.sum() <= 3.0
    assert data.qpos[2] == pytest.approx(robot.standing_height, abs=0.015)
    assert data.ncon == len(LEGS)


@pytest.mark.parametrize("name", MODELS)
def test_every_self_model_is_of_the_same_body(name: str, robot: Robot):
    model = self_model(name).model
    np.testing.assert_array_equal(model.body_mass, robot.model.body_mass)
    np.testing.assert_array_equal(model.jnt_range, robot.model.jnt_range)


def test_the_hexapod_walks_forward_no_faster_than_its_servos_turn(robot: Robot):
    walk = tripod(robot)
    assert walk["base_position"][-1, 0] > 0.2
    assert np.median(np.abs(walk["joint_velocities"]).max(axis=1)) < 1.1 * VELOCITY
    assert np.abs(walk["base_position"][-1, 1]) < 0.1


@pytest.mark.parametrize("legs", [legs for group in CASES.values() for legs in group])
def test_failed_legs_are_locked_above_the_ground_whatever_is_commanded(legs: str, robot: Robot):
    failed, hinges = retracted(legs), robot.anatomy.hinges
    with HexapodEnvironment(robot, 0, legs, gain=0.1) as environment:
        environment.reset()
        heights = {leg: environment._bullet.positions()[f"{leg}_foot"][2] for leg in LEGS}
        for _ in range(10):
            measured = environment.step(np.full(18, 0.2)).observation["joint_positions"]

    errors = [measured[hinges.index(hinge)] - angle for hinge, angle in failed.items()]
    np.testing.assert_allclose(errors, 0.0, atol=0.06)
    assert len(failed) == 3 * len(legs.split("+"))
    assert min(heights[leg] for leg in legs.split("+")) > 0.03
    assert max(heights[leg] for leg in LEGS if leg not in legs) < 0.03


def test_a_table_has_a_line_for_each_self_model():
    row = {"command": "walk", "gain": 0.1, "design": "network", "group": "intact", "seconds": 1}
    walk = {"predicted": 2.0, "finer": 1.0, "walked": 0.5, "heading": -20.0, "fell": False}

    _, _, first, second = table([row | walk | {"model": m} for m in ("a", "b")]).splitlines()

    assert first.startswith("| a | 0.1 | network | intact | 2 | 1 | 0.5 | 0.25 | 20 | 0/1, 0 %")
    assert second.startswith("| b |")
