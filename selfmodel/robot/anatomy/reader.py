"""Reads the anatomy of a robot from its compiled model."""

import math

import mujoco

from selfmodel.robot.anatomy.anatomy import Anatomy, Joint, Sensor
from selfmodel.robot.anatomy.transmission import (
    descends,
    has_feedback,
    motor_bodies,
    motor_joints,
)
from selfmodel.robot.base.root_body import joints_of_body

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_TOUCH = int(mujoco.mjtSensor.mjSENS_TOUCH)
_ANGLE = int(mujoco.mjtSensor.mjSENS_JOINTPOS)


def driven_joints(model: mujoco.MjModel) -> frozenset[int]:
    """Returns the ids of the joints that motors move."""
    return frozenset[int]().union(*(motor_joints(model, m) for m in range(model.nu)))


def read_anatomy(model: mujoco.MjModel, root: int) -> Anatomy:
    """Returns the anatomy of a robot: its named parts.

    The hinges of one body form one joint if a motor moves at least one of them. The joint has the
    common prefix of their names, or else the name of the body. Touch sensors and joint position
    sensors are the inputs of the controller.

    Args:
        model: A compiled MJCF that ``check_model`` accepts.
        root: Id of the root body, whose joints belong to no limb.

    Raises:
        ValueError: Two joints would have the same name.
    """
    base_joints = joints_of_body(model, root)
    hinges = [j for j in range(model.njnt) if model.jnt_type[j] == _HINGE and j not in base_joints]
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
        floating_base=model.body(root).name if base_joints else "",
    )


def _joint(
    model: mujoco.MjModel,
    body: int,
    groups: dict[int, list[int]],
    names: dict[int, str],
    sensors: tuple[Sensor, ...],
) -> Joint:
    """Returns the joint of a body, given the hinges and the joint name of each body."""
    group = groups[body]
    subtree = frozenset(b for b in range(body, model.nbody) if descends(model, b, body))
    bodies = frozenset(model.body(b).name for b in subtree)
    moved = {m: motor_joints(model, m) for m in range(model.nu)}
    motors = [m for j in group for m in moved if j == min(moved[m], default=-1)]
    return Joint(
        name=names[body],
        hinges=tuple(model.joint(j).name for j in group),
        motors=tuple(model.actuator(m).name for m in motors),
        servos=tuple(model.actuator(m).name for m in motors if has_feedback(model, m)),
        bodies=bodies,
        descendants=frozenset(
            [names[b] for b in groups if b != body and b in subtree]
            + [sensor.name for sensor in sensors if sensor.body in bodies]
        ),
        limits=tuple(joint_limits(model, j) for j in group),
        motors_lost_if_broken=frozenset(
            model.actuator(m).name for m in moved if motor_bodies(model, m) & subtree
        ),
        motors_lost_if_jammed=frozenset(
            model.actuator(m).name for m in moved if moved[m] and moved[m].issubset(group)
        ),
    )


def joint_limits(model: mujoco.MjModel, hinge: int) -> tuple[float, float]:
    """Returns the lower and upper angle of a hinge, rad; -pi and pi if it has no limits."""
    if not model.jnt_limited[hinge]:
        return -math.pi, math.pi
    low, high = model.jnt_range[hinge]
    return float(low), float(high)


def _joint_names(model: mujoco.MjModel, groups: dict[int, list[int]]) -> dict[int, str]:
    """Returns the joint name per body: the common prefix of its hinges, or the body's name."""
    prefixes = {
        body: _common_prefix([model.joint(j).name for j in group]) or str(model.body(body).name)
        for body, group in groups.items()
    }
    all_prefixes = list(prefixes.values())
    names = {
        body: name if all_prefixes.count(name) == 1 else str(model.body(body).name)
        for body, name in prefixes.items()
    }
    repeated = {name for name in names.values() if list(names.values()).count(name) > 1}
    if repeated:
        raise ValueError(
            f"expected a different name for each joint, got two joints with the name "
            f"{min(repeated)!r}, by the common prefix of their hinges or by their bodies: rename "
            f"their hinges"
        )
    return names


def _common_prefix(hinges: list[str]) -> str:
    """Returns the common prefix: ``front_left_hip`` for ``_swing`` and ``_lift`` of one body."""
    prefix = hinges[0]
    while not all(name.startswith(prefix) for name in hinges):
        prefix = prefix[:-1]
    return prefix.rstrip("_")


def _sensors(model: mujoco.MjModel, hinges: list[int]) -> tuple[Sensor, ...]:
    touch, angle = [], []
    for s in range(model.nsensor):
        name, target = model.sensor(s).name, int(model.sensor_objid[s])
        if model.sensor_type[s] == _TOUCH:
            body = model.body(model.site_bodyid[target]).name
            touch.append(Sensor(name, "touch", body, "", 1.0, 0.0))
        elif model.sensor_type[s] == _ANGLE and target in hinges:
            low, high = joint_limits(model, target)
            body = model.body(model.jnt_bodyid[target]).name
            hinge = model.joint(target).name
            angle.append(Sensor(name, "angle", body, hinge, (high - low) / 2, (low + high) / 2))
    return tuple(touch + angle)
