"""Tests of faults with severities and of environments against hand-written models."""

import math
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.faults.terrain import (
    CELL_SIZE,
    CELLS_PER_BUMP,
    FLAT_RADIUS,
    HALF_EXTENT,
    unit_heights,
)
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.simulation.simulator import Simulator
from tests.faults.test_build import assert_same_paths, follow
from tests.helpers.drivers import random_controllers, random_motion

STEPS = 100


def built(robot: Robot, text: str, seed: int = 0) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy), seed).model


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


def test_a_joint_that_two_motors_pull_at_is_weakened_once():
    robot = Robot(
        "pulled",
        """<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="0 0 1"/>
        <body name="trunk" pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
          <body name="leg">
            <joint name="hip" axis="0 1 0" range="-60 60" actuatorfrcrange="-10 10"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body></worldbody>
        <actuator><motor name="flexor" joint="hip" ctrlrange="0 1" gear="10"/>
          <motor name="extensor" joint="hip" ctrlrange="0 1" gear="-10"/></actuator></mujoco>""",
        0.02,
    )
    weak = built(robot, "motor:hip=0.5")

    np.testing.assert_allclose(weak.actuator_gainprm[:, 0], 0.5)
    np.testing.assert_allclose(weak.jnt_actfrcrange[weak.joint("hip").id], [-5, 5])


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


def test_a_motor_without_torque_moves_like_a_model_without_the_motor(robot: Robot):
    joint = robot.anatomy.joints[0]
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    for motor in joint.motors:
        spec.delete(spec.actuator(motor))
    weak = built(robot, f"motor:{joint.name}=0.0")

    assert_same_paths(follow(robot, weak, STEPS), follow(robot, spec.compile(), STEPS))


def test_friction_is_the_model_with_that_friction(robot: Robot):
    truth = compiled(robot, 'friction="1 0.005', 'friction="0.4 0.005')
    slippery = follow(robot, built(robot, "friction=0.4"), STEPS)

    assert_identical_paths(slippery, follow(robot, truth, STEPS))
    moved = slippery["torso"][-1] - follow(robot, robot.model, STEPS)["torso"][-1]
    assert np.abs(moved).max() > 1e-3  # so friction has an effect


def test_friction_leaves_what_cannot_touch_the_world_alone():
    mjcf = """<mujoco><worldbody>
      <geom name="ground" type="plane" size="0 0 1" contype="1" conaffinity="0" friction="0.9"/>
      <body><freejoint/>
        <geom name="foot" size="0.1" contype="0" conaffinity="1" friction="0.7"/>
        <geom name="hand" size="0.1" contype="2" conaffinity="2" friction="0.5"/>
      </body></worldbody></mujoco>"""
    robot = Robot("ball", mjcf, 0.002)
    model = built(robot, "friction=0.3")

    assert [model.geom(name).friction[0] for name in ("ground", "foot", "hand")] == [0.3, 0.3, 0.5]


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


@pytest.mark.parametrize("angle", [0.17, -0.3])
def test_a_slope_pulls_like_gravity_that_leans(robot: Robot, angle: float):
    # A friction pyramid depends on the rotation of the ground; a cone does not.
    mjcf = robot.mjcf.replace('cone="pyramidal"', 'cone="elliptic"')
    # MuJoCo's contact frame is not orthogonal for an upright leg on tilted ground, so both robots
    # fall a little first, while their legs move.
    height = robot.standing_height
    assert f'name="torso" pos="0 0 {height}"' in mjcf
    mjcf = mjcf.replace(f'pos="0 0 {height}"', f'pos="0 0 {height + 0.1}"')
    robot = Robot(robot.name, mjcf, robot.control_timestep)
    leaning = robot.specification()
    leaning.option.gravity = 9.81 * np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    truth = follow(robot, leaning.compile(), STEPS)
    tilt = np.empty(4)
    mujoco.mju_axisAngle2Quat(tilt, np.array([0.0, 1.0, 0.0]), -angle)
    for pose in truth["torso"]:
        position, orientation = pose[:3].copy(), pose[3:].copy()
        mujoco.mju_rotVecQuat(pose[:3], position, tilt)
        mujoco.mju_mulQuat(pose[3:], tilt, orientation)

    assert_same_paths(follow(robot, built(robot, f"slope={angle}"), STEPS), truth)


@pytest.mark.parametrize("roughness", ["", "+roughness=0.02"])
def test_a_robot_on_a_slope_stands_on_the_ground_as_on_level_ground(robot: Robot, roughness: str):
    for text in (f"slope=0.2{roughness}", roughness.removeprefix("+") or "intact"):
        embodiment = build(robot, parse(text, robot.anatomy))
        data = mujoco.MjData(embodiment.model)
        mujoco.mj_forward(embodiment.model, data)
        place = data.body(robot.root).xpos

        assert place @ embodiment.normal == pytest.approx(robot.standing_height)
        assert data.body(robot.root).xmat.reshape(3, 3)[:, 2] == pytest.approx(embodiment.normal)


def test_wind_is_the_model_with_that_wind(robot: Robot):
    air = 'density="1.2" viscosity="1.8e-5"'
    truth = compiled(robot, "<option ", f'<option wind="-15 6 0" {air} ')
    blown = follow(robot, built(robot, "wind=-15+crosswind=6"), STEPS)

    assert robot.model.opt.density == 0  # a nominal robot walks in a vacuum
    assert_identical_paths(blown, follow(robot, truth, STEPS))


def test_what_swims_stays_in_its_water_when_that_moves(quadruped: Robot):
    swimmer = Robot(
        "swimmer", quadruped.mjcf.replace("<option ", '<option density="1000" ', 1), 0.01
    )
    syrup = Robot("syrup", quadruped.mjcf.replace("<option ", '<option viscosity="2" ', 1), 0.01)

    moved, thick = (built(robot, "wind=2").opt for robot in (swimmer, syrup))
    assert (moved.density, moved.viscosity, moved.wind[0]) == (1000, 0, 2)
    assert (thick.density, thick.viscosity, thick.wind[0]) == (0, 2, 2)


@pytest.mark.parametrize(("word", "axis"), [("wind", 0), ("crosswind", 1)])
def test_positive_wind_blows_forward_and_to_the_left(quadruped: Robot, word: str, axis: int):
    with_wind, against = (
        follow(quadruped, built(quadruped, f"{word}={speed}"), 50)["torso"][-1, axis]
        for speed in (30, -30)
    )

    assert with_wind > against


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


def test_another_seed_is_another_terrain_of_the_same_roughness(quadruped: Robot):
    same, again, other = (built(quadruped, "roughness=0.02", seed) for seed in (0, 0, 7))

    assert np.array_equal(same.hfield_data, again.hfield_data)
    assert not np.array_equal(same.hfield_data, other.hfield_data)
    np.testing.assert_allclose(same.hfield_size, other.hfield_size, rtol=0.05)


def test_a_world_without_level_ground_cannot_become_rough():
    mjcf = """<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""
    robot = Robot("ball", mjcf, 0.002)

    with pytest.raises(InputError, match="replaces a ground plane"):
        built(robot, "roughness=0.02")


def test_readings_have_the_gain_and_then_the_bias(quadruped: Robot):
    def first(text: str) -> np.ndarray:
        embodiment = build(quadruped, parse(text, quadruped.anatomy))
        senses = SensorReader(quadruped.model, quadruped.anatomy, [embodiment])
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
    ran = Simulator(quadruped, 2).run(runs, 1000, ["sensors", "joint_positions"]).behaviour
    alone = Simulator(quadruped, 1).run(runs[1:2], 1000, ["sensors"]).behaviour
    hinge = quadruped.anatomy.hinges.index("front_left_shoulder")
    half = quadruped.anatomy.sensor("front_left_angle").half_range
    noise = ran["sensors"][:, :, 4] - ran["joint_positions"][:, :, hinge] / half

    assert np.array_equal(alone["sensors"][0], ran["sensors"][1])
    assert np.abs(noise[[0, 3]]).max() < 1e-12
    assert noise[1].std() == pytest.approx(0.2, rel=0.1)
    assert abs(noise[1].mean()) < 0.03
    np.testing.assert_allclose(noise[2], noise[1], atol=1e-12)


def test_another_seed_is_another_noise(quadruped: Robot):
    text = "sensor:front_left_angle=noise0.2"
    embodiments = [build(quadruped, parse(text, quadruped.anatomy), seed) for seed in (0, 0, 1)]
    senses = SensorReader(quadruped.model, quadruped.anatomy, embodiments)
    readings = np.empty((3, 8))
    senses.read(np.zeros((3, 8)), np.tile(quadruped.model.qpos0, (3, 1)), readings)

    assert readings[0, 4] == readings[1, 4] != readings[2, 4]


def test_nothing_of_an_environment_is_left_in_the_robot(robot: Robot):
    gravity, wind = robot.model.opt.gravity.copy(), robot.model.opt.wind.copy()
    built(robot, "slope=0.2+wind=10+crosswind=3+friction=0.2+roughness=0.02")

    assert np.array_equal(robot.model.opt.gravity, gravity)
    assert np.array_equal(robot.model.opt.wind, wind)
    assert build(robot, INTACT).model.opt.density == 0
