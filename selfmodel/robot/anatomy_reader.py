"""Reads the parts of a robot off its compiled model."""

import math

import mujoco

from selfmodel.robot.anatomy import Anatomy, Joint, Sensor
from selfmodel.robot.floating_base import joints_of
from selfmodel.robot.transmission import descends, motor_bodies, motor_joints

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_TOUCH = int(mujoco.mjtSensor.mjSENS_TOUCH)
_ANGLE = int(mujoco.mjtSensor.mjSENS_JOINTPOS)


def driven_joints(model: mujoco.MjModel) -> frozenset[int]:
    """Returns the numbers of the joints that motors move."""
    return frozenset[int]().union(*(motor_joints(model, m) for m in range(model.nu)))


def read_anatomy(model: mujoco.MjModel, root: int) -> Anatomy:
    """Returns the parts of a robot that its model names.

    The hinges of one body are one joint if a motor moves any of them. It is called by what their
    names begin with, or else by the body. Touch sensors and joint position sensors feed the
    controller.

    Args:
        model: A compiled MJCF that ``carried.check_model`` lets through.
        root: The number of the root body, whose own joints are not the limbs'.

    Raises:
        ValueError: Two joints would be called alike.
    """
    own = joints_of(model, root)
    hinges = [j for j in range(model.njnt) if model.jnt_type[j] == _HINGE and j not in own]
    driven = driven_joints(model)
    groups: dict[int, list[int]] = {}
    for j in hinges:
        groups.setdefault(int(model.jnt_bodyid[j]), []).append(j)
    groups = {body: group for body, group in groups.items() if driven.intersection(group)}
    sensors = _sensors(model, hinges)
    names = _joint_names(model, groups)
    return Anatomy(
        joints=tuple(_joint(model, body, groups, names, sensors) for body in groups),
        sensors=sensors,
        motors=tuple(model.actuator(m).name for m in range(model.nu)),
        hinges=tuple(model.joint(j).name for j in hinges),
    )


def _joint(
    model: mujoco.MjModel,
    body: int,
    groups: dict[int, list[int]],
    names: dict[int, str],
    sensors: tuple[Sensor, ...],
) -> Joint:
    group = groups[body]
    beyond = frozenset(b for b in range(body, model.nbody) if descends(model, b, body))
    lost = frozenset(model.body(b).name for b in beyond)
    moved = {m: motor_joints(model, m) for m in range(model.nu)}
    return Joint(
        name=names[body],
        hinges=tuple(model.joint(j).name for j in group),
        motors=tuple(
            model.actuator(m).name for j in group for m in moved if j == min(moved[m], default=-1)
        ),
        bodies=lost,
        lost=frozenset(
            [names[b] for b in groups if b != body and b in beyond]
            + [sensor.name for sensor in sensors if sensor.body in lost]
        ),
        limits=tuple(_limits(model, j) for j in group),
        slack=frozenset(model.actuator(m).name for m in moved if motor_bodies(model, m) & beyond),
        idle=frozenset(
            model.actuator(m).name for m in moved if moved[m] and moved[m].issubset(group)
        ),
    )


def _limits(model: mujoco.MjModel, hinge: int) -> tuple[float, float]:
    if not model.jnt_limited[hinge]:
        return -math.pi, math.pi
    low, high = model.jnt_range[hinge]
    return float(low), float(high)


def _joint_names(model: mujoco.MjModel, groups: dict[int, list[int]]) -> dict[int, str]:
    """What each joint is called, by its body: what its hinges share, or what its body is called."""
    names = {
        body: _shared_name([model.joint(j).name for j in group]) or str(model.body(body).name)
        for body, group in groups.items()
    }
    told = list(names.values())
    names = {
        body: name if told.count(name) == 1 else str(model.body(body).name)
        for body, name in names.items()
    }
    twice = {name for name in names.values() if list(names.values()).count(name) > 1}
    if twice:
        raise ValueError(
            f"two joints of the model would both be called {min(twice)!r}, by what the names of "
            f"their hinges begin with or by their bodies: give their hinges other names"
        )
    return names


def _shared_name(hinges: list[str]) -> str:
    """What all names have in common: ``front_left_hip`` of its ``_swing`` and ``_lift``."""
    shared = hinges[0]
    while not all(name.startswith(shared) for name in hinges):
        shared = shared[:-1]
    return shared.rstrip("_")


def _sensors(model: mujoco.MjModel, hinges: list[int]) -> tuple[Sensor, ...]:
    touch, angle = [], []
    for s in range(model.nsensor):
        name, target = model.sensor(s).name, int(model.sensor_objid[s])
        if model.sensor_type[s] == _TOUCH:
            body = model.body(model.site_bodyid[target]).name
            touch.append(Sensor(name, "touch", body, "", 1.0, 0.0))
        elif model.sensor_type[s] == _ANGLE and target in hinges:
            low, high = _limits(model, target)
            body = model.body(model.jnt_bodyid[target]).name
            hinge = model.joint(target).name
            angle.append(Sensor(name, "angle", body, hinge, (high - low) / 2, (low + high) / 2))
    return tuple(touch + angle)
