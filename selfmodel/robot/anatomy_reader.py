"""Reads the anatomy of a robot, and its root body, from its compiled model."""

import math

import mujoco
import numpy as np

from selfmodel.robot.actuators import (
    descends,
    has_feedback,
    motor_bodies,
    motor_joints,
)
from selfmodel.robot.anatomy import Anatomy, Joint, Sensor

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


_FREE, _SLIDE, _HINGE = (
    int(mujoco.mjtJoint.mjJNT_FREE),
    int(mujoco.mjtJoint.mjJNT_SLIDE),
    int(mujoco.mjtJoint.mjJNT_HINGE),
)


def joints_of_body(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def find_root_body(model: mujoco.MjModel, driven: frozenset[int]) -> int:
    """Returns the id of the root body of a robot.

    The root body is the body with a free joint or with slide joints. Without such a body the base
    is fixed, and the root body is the static body that carries all driven joints: of several, the
    one nearest to the joints.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.

    Raises:
        ValueError: The model has several floating bases; or none, and slide joints on a body of the
            world, or no static body below the world that carries all driven joints.
    """
    floating = floating_bodies(model, driven)
    if len(floating) > 1:
        names = ", ".join(model.body(body).name or f"number {body}" for body in floating)
        raise ValueError(
            f"expected one root body that moves freely, got {names}: keep the robot, and remove "
            f"the other bodies or fix them to the world"
        )
    if floating:
        return floating[0]
    if not driven:
        raise ValueError("the motors drive no joint: give the joints of the limbs motors")
    _check_hinged(model)
    carrier = common_carrier(model, driven)
    if not carrier:
        raise ValueError(
            "the driven joints are on several bodies of the world, or directly on one, and the "
            "base is fixed: put them into one <body>, which is the root body"
        )
    return carrier


def floating_bodies(model: mujoco.MjModel, driven: frozenset[int]) -> list[int]:
    """Returns the ids of the bodies that can be a floating base.

    Args:
        model: A compiled MJCF.
        driven: Ids of the joints that motors move.
    """
    free = [int(model.jnt_bodyid[j]) for j in np.flatnonzero(model.jnt_type == _FREE)]
    return free or [
        body
        for body in np.flatnonzero(model.body_parentid == 0).tolist()
        if body and _is_sliding_base(model, body, driven)
    ]


def common_carrier(model: mujoco.MjModel, joints: frozenset[int]) -> int:
    """Returns the id of the static body nearest to some joints that carries all of them.

    Args:
        model: A compiled MJCF.
        joints: Ids of at least one joint.

    Returns:
        The id of the body; 0, the world, if no other static body carries all the joints.
    """
    chains = [_static_chain(model, int(model.jnt_bodyid[joint])) for joint in joints]
    return max(set(chains[0]).intersection(*chains[1:]))


def _static_chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the static bodies that carry a body, with the world."""
    chain = []
    while body:
        body = int(model.body_parentid[body])
        if not model.body_weldid[body]:
            chain.append(body)
    return chain


def _check_hinged(model: mujoco.MjModel) -> None:
    """Refuses bodies of a world that have a slide or ball joint and are no floating base."""
    for joint in range(model.njnt):
        parent = int(model.body_parentid[model.jnt_bodyid[joint]])
        if model.jnt_type[joint] != _HINGE and not model.body_weldid[parent]:
            raise ValueError(
                f"the model needs a root body with a free joint, with slide joints and then at "
                f"most one hinge that no motor moves, or without a joint (its base is fixed), and "
                f"the body {model.body(model.jnt_bodyid[joint]).name or 'without a name'} has "
                f"other joints: give the root body a <freejoint/>, or only hinges to its parent"
            )


def _is_sliding_base(model: mujoco.MjModel, body: int, driven: frozenset[int]) -> bool:
    joints = joints_of_body(model, body)
    kinds = [int(model.jnt_type[j]) for j in joints]
    slides = kinds.count(_SLIDE)
    if not slides or kinds not in ([_SLIDE] * slides, [_SLIDE] * slides + [_HINGE]):
        return False
    independent = np.linalg.matrix_rank(model.jnt_axis[joints[:slides]]) == slides
    return bool(independent) and not driven.intersection(joints)
