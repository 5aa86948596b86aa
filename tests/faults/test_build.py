"""Tests of model edits: a broken joint equals a deleted limb, a jammed joint equals a weld.

The reference model has another layout, so rounding differs and contact amplifies the difference:
the comparison covers the first 100 control steps (1 s) of a motion of every joint of selfmodel's
robots. (Measured: below 1e-13 for broken joints, below 3e-9 for jammed ones.)
"""

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Joint
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from tests.helpers.drivers import random_motion
from tests.helpers.robots.bodies import BODIES, swinging

STEPS = 100
TOLERANCE = 1e-7
Motion = Callable[[Robot, int], np.ndarray]

MADE: Mapping[str, Callable[[], Robot]] = {
    **{name: entry.robot for name, entry in ROBOTS.items()},
    **{f"{name} of the suite": made for name, made in BODIES.items()},
}

OWN = [
    (name, joint.name)
    for name, entry in ROBOTS.items()
    for joint in entry.robot().anatomy.joints[:: 3 if name == "quadruped" else 5]
]
"""Inner and outer joints, left and right."""


def of_suite(names: Sequence[str], count: int) -> list[tuple[str, str]]:
    """The last joints of bodies that slide, or whose motors pull tendons or lag behind."""
    bodies = [f"{name} of the suite" for name in names]
    return [(name, one.name) for name in bodies for one in MADE[name]().anatomy.joints[-count:]]


def built(robot: Robot, text: str, seed: int = 0) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy), seed).model


def without_limb(robot: Robot, joint: Joint) -> mujoco.MjModel:
    """The robot's model with the limb beyond a joint deleted."""
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    first = next(b for b in joint.bodies if spec.body(b).parent.name not in joint.bodies)
    spec.delete(spec.body(first))
    return spec.compile()


def with_weld(robot: Robot, joint: Joint, angle: float) -> mujoco.MjModel:
    """The robot's model with a joint's body welded where the physics has it at an angle."""
    data = mujoco.MjData(robot.model)
    for hinge in joint.hinges:
        data.joint(hinge).qpos[0] = angle
    mujoco.mj_kinematics(robot.model, data)
    body = robot.model.body(robot.model.joint(joint.hinges[0]).bodyid[0])
    parent, back = data.body(int(body.parentid[0])), np.empty(4)
    mujoco.mju_negQuat(back, parent.xquat)
    place, turn = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(place, data.body(body.id).xpos - parent.xpos, back)
    mujoco.mju_mulQuat(turn, back, data.body(body.id).xquat)
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    spec.body(body.name).pos, spec.body(body.name).quat = place, turn
    for name in joint.hinges:
        users = [motor for motor in spec.actuators if motor.target == name]
        users += [sensor for sensor in spec.sensors if sensor.objname == name]
        for part in (*users, spec.joint(name)):
            spec.delete(part)
    return spec.compile()


def follow(
    robot: Robot, model: mujoco.MjModel, steps: int, motion: Motion = random_motion
) -> dict[str, np.ndarray]:
    """Returns the paths of the root body and of the hinges under given motor targets."""
    data = mujoco.MjData(model)
    hinges = {model.joint(j).name for j in range(model.njnt)} & set(robot.anatomy.hinges)
    motors = {model.actuator(m).name for m in range(model.nu)}
    paths: dict[str, list] = {name: [] for name in (robot.root, *hinges)}
    for targets in motion(robot, steps):
        for motor, target in zip(robot.anatomy.motors, targets, strict=True):
            if motor in motors:
                data.actuator(motor).ctrl = target
        mujoco.mj_step(model, data, robot.substeps)
        root = data.body(robot.root)
        paths[robot.root].append([*root.xpos, *root.xquat])
        for hinge in hinges:
            paths[hinge].append(float(data.joint(hinge).qpos[0]))
    return {name: np.array(path) for name, path in paths.items()}


def assert_same_paths(
    edited: dict[str, np.ndarray], truth: dict[str, np.ndarray], tolerance: float = TOLERANCE
):
    assert len(truth) > 1
    for name, path in truth.items():
        np.testing.assert_allclose(edited[name], path, atol=tolerance, rtol=0, err_msg=name)


def check(name: str, text: str, truth: mujoco.MjModel, steps: int, tolerance: float = TOLERANCE):
    """Checks that a robot with a fault moves like a model of another layout."""
    robot = MADE[name]()
    edited = built(robot, text)
    how = (STEPS, random_motion) if name in ROBOTS else (steps, swinging)

    assert truth.nv < edited.nv == robot.model.nv
    assert_same_paths(*(follow(robot, model, *how) for model in (edited, truth)), tolerance)


@pytest.mark.parametrize(
    ("name", "joint"), [*OWN, *of_suite(("walker", "swimmer", "quadruped", "ant"), 2)]
)
def test_a_broken_joint_moves_like_a_model_without_the_limb(name: str, joint: str):
    robot = MADE[name]()
    broken = robot.anatomy.joint(joint)
    truth = without_limb(robot, broken)
    left = {truth.actuator(m).name for m in range(truth.nu)}

    check(name, f"break:{joint}", truth, 40)
    assert broken.motors_lost_if_broken == set(robot.anatomy.motors) - left


@pytest.mark.parametrize(
    ("name", "joint"), [*OWN, *of_suite(("walker", "swimmer", "ant", "humanoid"), 1)]
)
def test_a_jammed_joint_moves_like_a_welded_one(name: str, joint: str):
    robot = MADE[name]()
    held = robot.anatomy.joint(joint)
    low, high = held.limits[0]
    angle = low + (0.3 if "left" in joint else 0.8) * (high - low)

    check(name, f"jam:{joint}={angle}", with_weld(robot, held, angle), 20, 1e-6)


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
