"""Tests of model edits: a broken joint equals a deleted limb, a jammed joint equals a weld.

The reference model has another layout, so rounding differs and contact amplifies the difference:
the comparison covers the first 100 control steps (1 s) of a motion of every joint, over which all
joint angles and the root body's pose agree within TOLERANCE. (Measured: below 1e-13 for broken
joints, below 3e-9 for jammed ones.)
"""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Joint
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from tests.helpers.drivers import random_motion

STEPS = 100
TOLERANCE = 1e-7

JOINTS = [
    (name, joint.name)
    for name, entry in ROBOTS.items()
    for joint in entry.robot().anatomy.joints[:: 3 if name == "quadruped" else 5]
]
"""Inner and outer joints, left and right."""


def built(robot: Robot, text: str, seed: int = 0) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy), seed).model


def without_limb(robot: Robot, joint: Joint) -> mujoco.MjModel:
    """The robot's model with the limb beyond a joint deleted."""
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    first = next(b for b in joint.bodies if spec.body(b).parent.name not in joint.bodies)
    spec.delete(spec.body(first))
    return spec.compile()


def with_weld(robot: Robot, joint: Joint, angle: float) -> mujoco.MjModel:
    """The robot's model with the bodies of a joint welded at an angle, without the joint."""
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    for name in joint.hinges:
        hinge = spec.joint(name)
        body = hinge.parent
        np.testing.assert_array_equal(hinge.pos, 0)  # so rotating the body does not move the pivot
        turn, frame = np.empty(4), np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(hinge.axis), angle)
        mujoco.mju_mulQuat(frame, np.array(body.quat), turn)
        body.quat = frame
        users = [motor for motor in spec.actuators if motor.target == name]
        users += [sensor for sensor in spec.sensors if sensor.objname == name]
        for user in users:
            spec.delete(user)
        spec.delete(hinge)
    return spec.compile()


def follow(robot: Robot, model: mujoco.MjModel, steps: int) -> dict[str, np.ndarray]:
    """Returns the trajectories of the root body and of the hinges under given motor targets."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hinges = {model.joint(j).name for j in range(model.njnt)} & set(robot.anatomy.hinges)
    motors = {model.actuator(m).name for m in range(model.nu)}
    paths: dict[str, list] = {name: [] for name in (robot.root, *hinges)}
    for targets in random_motion(robot, steps):
        for motor, target in zip(robot.anatomy.motors, targets, strict=True):
            if motor in motors:
                data.actuator(motor).ctrl = target
        mujoco.mj_step(model, data, robot.substeps)
        paths[robot.root].append(data.qpos[:7].copy())
        for hinge in hinges:
            paths[hinge].append(float(data.joint(hinge).qpos[0]))
    return {name: np.array(path) for name, path in paths.items()}


def assert_same_paths(edited: dict[str, np.ndarray], truth: dict[str, np.ndarray]):
    assert len(truth) > 1
    for name, path in truth.items():
        np.testing.assert_allclose(edited[name], path, atol=TOLERANCE, rtol=0, err_msg=name)


@pytest.mark.parametrize(("name", "joint"), JOINTS)
def test_a_broken_joint_moves_like_a_model_without_the_limb(name: str, joint: str):
    robot = ROBOTS[name].robot()
    edited = build(robot, parse(f"break:{joint}", robot.anatomy)).model
    truth = without_limb(robot, robot.anatomy.joint(joint))

    assert truth.nv < edited.nv == robot.model.nv
    assert_same_paths(follow(robot, edited, STEPS), follow(robot, truth, STEPS))


@pytest.mark.parametrize(("name", "joint"), JOINTS)
def test_a_jammed_joint_moves_like_a_welded_one(name: str, joint: str):
    angle = 0.3 if "left" in joint else -0.5
    robot = ROBOTS[name].robot()
    edited = build(robot, parse(f"jam:{joint}={angle}", robot.anatomy)).model
    truth = with_weld(robot, robot.anatomy.joint(joint), angle)

    assert truth.nv < edited.nv == robot.model.nv
    assert_same_paths(follow(robot, edited, STEPS), follow(robot, truth, STEPS))


def test_lost_and_failed_sensors_read_zero_and_jammed_ones_their_angle(quadruped: Robot):
    names = quadruped.anatomy.names.sensors

    def fixed(text: str) -> dict[str, float]:
        built = build(quadruped, parse(text, quadruped.anatomy))
        return {
            name: float(offset)
            for name, gain, offset in zip(names, built.gain, built.offset, strict=True)
            if gain == 0
        }

    assert fixed("sensor:back_left_touch") == {"back_left_touch": 0.0}
    assert fixed("break:front_left_knee") == {"front_left_touch": 0.0}
    assert fixed("break:front_left_shoulder") == {"front_left_touch": 0.0, "front_left_angle": 0.0}
    half = quadruped.anatomy.sensor("front_left_angle").half_range
    assert fixed("jam:front_left_shoulder=0.3") == {"front_left_angle": 0.3 / half}
    assert fixed("jam:front_left_knee=0.3") == {}
