"""Tests of faults with severities and of environments against hand-written models."""

import math
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.faults.world import CELL_SIZE, CELLS_PER_BUMP, FLAT_RADIUS, HALF_EXTENT, unit_heights
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorReader
from selfmodel.simulation.simulator import Simulator
from tests.faults.test_build import assert_same_paths, built, follow
from tests.helpers.drivers import random_controllers, random_motion

STEPS = 100


def compiled(robot: Robot, before: str, after: str) -> mujoco.MjModel:
    """The robot's model with some of its MJCF replaced."""
    assert before in robot.mjcf
    return mujoco.MjModel.from_xml_string(robot.mjcf.replace(before, after))


def assert_identical_paths(one: dict[str, np.ndarray], other: dict[str, np.ndarray]):
    assert all(np.array_equal(one[name], other[name]) for name in one)


def states(robot: Robot, count: int) -> Iterator[mujoco.MjData]:
    """The robot in the middle of a motion, with distant targets."""
    data = mujoco.MjData(robot.model)
    for targets in random_motion(robot, count):
        data.ctrl = targets * 1.5
        mujoco.mj_step(robot.model, data, 10)
        yield data


@pytest.mark.parametrize("part", [0.0, 0.3, 0.7])
def test_a_weak_motor_has_that_part_of_its_torque_at_any_load(robot: Robot, part: float):
    joint = robot.anatomy.joints[0]
    weak = built(robot, f"motor:{joint.name}={part}")
    mine = np.isin(robot.anatomy.motors, joint.motors)
    saturated = False
    for data in states(robot, 30):
        other = mujoco.MjData(weak)
        other.qpos, other.qvel, other.ctrl = data.qpos, data.qvel, data.ctrl
        for model, each in ((robot.model, data), (weak, other)):
            mujoco.mj_forward(model, each)
        np.testing.assert_allclose(
            other.actuator_force[mine], part * data.actuator_force[mine], rtol=1e-12
        )
        np.testing.assert_array_equal(other.actuator_force[~mine], data.actuator_force[~mine])
        limit = robot.model.actuator_forcerange[mine, 1]
        saturated |= bool(np.any(np.abs(data.actuator_force[mine]) == limit))

    assert saturated  # so the torque limits are tested


def test_friction_is_the_model_with_that_friction(robot: Robot):
    truth = compiled(robot, 'friction="1 0.005', 'friction="0.4 0.005')
    slippery = follow(robot, built(robot, "friction=0.4"), STEPS)

    assert_identical_paths(slippery, follow(robot, truth, STEPS))
    moved = slippery["torso"][-1] - follow(robot, robot.model, STEPS)["torso"][-1]
    assert np.abs(moved).max() > 1e-3  # so friction has an effect


@pytest.mark.parametrize("angle", [0.17, -0.3])
def test_a_slope_is_the_model_on_tilted_ground(robot: Robot, angle: float):
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    tilt, turned = np.empty(4), np.empty(3)
    # Uphill along x: the x axis of the ground points up, by a negative rotation about y.
    mujoco.mju_axisAngle2Quat(tilt, np.array([0.0, 1.0, 0.0]), -angle)
    torso = spec.body("torso")
    mujoco.mju_rotVecQuat(turned, torso.pos, tilt)
    torso.pos, torso.quat = turned, tilt
    spec.geom("ground").quat = tilt

    assert_same_paths(
        follow(robot, built(robot, f"slope={angle}"), STEPS), follow(robot, spec.compile(), STEPS)
    )


@pytest.mark.parametrize("roughness", ["", "+roughness=0.02"])
def test_a_robot_on_a_slope_stands_on_the_ground_as_on_level_ground(robot: Robot, roughness: str):
    for text in (f"slope=0.2{roughness}", roughness.removeprefix("+") or "intact"):
        variant = build(robot, parse(text, robot.anatomy))
        data = mujoco.MjData(variant.model)
        mujoco.mj_forward(variant.model, data)
        place = data.body(robot.root).xpos

        assert place @ variant.normal == pytest.approx(robot.standing_height)
        assert data.body(robot.root).xmat.reshape(3, 3)[:, 2] == pytest.approx(variant.normal)


def test_wind_is_the_model_with_that_wind(robot: Robot):
    air = 'density="1.2" viscosity="1.8e-5"'
    truth = compiled(robot, "<option ", f'<option wind="-15 6 0" {air} ')
    blown = follow(robot, built(robot, "wind=-15+crosswind=6"), STEPS)

    assert robot.model.opt.density == 0  # a nominal robot walks in a vacuum
    assert_identical_paths(blown, follow(robot, truth, STEPS))


def test_rough_terrain_rises_and_falls_as_far_as_it_says(robot: Robot):
    model = built(robot, "roughness=0.04")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    down, hit = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    columns, rows = (range(-9 * CELLS_PER_BUMP, 9 * CELLS_PER_BUMP, 2) for _ in range(2))

    def height(x: float, y: float) -> float:
        start = np.array([x + 1e-6, y + 2e-6, 2.0])  # on an edge, a ray slips between triangles
        body = model.body(robot.root).id
        below = mujoco.mj_ray(model, data, start, down, np.array([1, 0, 0, 0, 0, 0]), 1, body, hit)
        return 2.0 - float(below)

    told = 0.04 * unit_heights(0)
    middle = [round(half / CELL_SIZE) for half in HALF_EXTENT]
    seen = {(c, r): height(c * CELL_SIZE, r * CELL_SIZE) for c in columns for r in rows}
    for (column, row), found in seen.items():
        if (
            math.hypot(column * CELL_SIZE, row * CELL_SIZE) > 1.5
        ):  # above the robot, the ray hits the robot
            assert found == pytest.approx(told[middle[1] + row, middle[0] + column], abs=1e-5)
    assert 0.03 < max(seen.values()) <= 0.04
    assert -0.04 <= min(seen.values()) < -0.03


def test_no_robot_starts_inside_rough_terrain(robot: Robot):
    heights = unit_heights(0)
    middle = np.array(heights.shape) // 2
    flat = int(FLAT_RADIUS / CELL_SIZE / math.sqrt(2))
    start = heights[
        middle[0] - flat : middle[0] + flat + 1, middle[1] - flat : middle[1] + flat + 1
    ]
    flat_forces, rough_forces = (
        forces_at_the_start(built(robot, text)) for text in ("intact", "roughness=0.04")
    )

    assert np.all(start == 0)
    assert np.abs(heights).max() <= 1
    np.testing.assert_allclose(rough_forces, flat_forces, rtol=0.2, atol=1)


def forces_at_the_start(model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    return data.sensordata[model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH]


def test_readings_have_the_gain_and_then_the_bias(quadruped: Robot):
    def first(text: str) -> np.ndarray:
        variant = build(quadruped, parse(text, quadruped.anatomy))
        senses = SensorReader(quadruped.model, quadruped.anatomy, [variant])
        qpos = quadruped.model.qpos0 + 0.1
        readings = np.empty((1, 8))
        senses.read(np.full((1, 8), 5.0), qpos[np.newaxis], readings)
        return readings[0]

    raw = first("intact")
    column = [sensor.name for sensor in quadruped.anatomy.sensors].index("front_left_angle")
    gained = first("sensor:front_left_angle=gain0.5+sensor:front_left_angle=bias-0.2")

    assert gained[column] == 0.5 * raw[column] - 0.2
    assert np.array_equal(np.delete(gained, column), np.delete(raw, column))
    assert first("sensor:front_left_touch=gain0.2")[0] == 0.2
    held = first("jam:front_left_shoulder=0.3+sensor:front_left_angle=gain0.5")
    assert held[column] == 0.5 * 0.3 / quadruped.anatomy.sensor("front_left_angle").half_range


def test_noise_has_its_deviation_and_is_the_same_whatever_else_is_wrong(quadruped: Robot):
    (controller,) = random_controllers(quadruped, 1)
    noisy = "sensor:front_left_angle=noise0.2"
    texts = ["intact", noisy, f"{noisy}+sensor:back_left_angle=noise0.1", "slope=0.1"]
    runs = [(parse(text, quadruped.anatomy), controller) for text in texts]
    ran = Simulator(quadruped, 2).run(runs, 400, ["sensors", "joint_positions"]).trajectory
    alone = Simulator(quadruped, 1).run(runs[1:2], 400, ["sensors"]).trajectory
    hinge = quadruped.anatomy.hinges.index("front_left_shoulder")
    half = quadruped.anatomy.sensor("front_left_angle").half_range
    noise = ran["sensors"][:, :, 4] - ran["joint_positions"][:, :, hinge] / half

    assert np.array_equal(alone["sensors"][0], ran["sensors"][1])
    assert np.abs(noise[[0, 3]]).max() < 1e-12
    assert noise[1].std() == pytest.approx(0.2, rel=0.1)
    assert abs(noise[1].mean()) < 0.03
    np.testing.assert_allclose(noise[2], noise[1], atol=1e-12)
