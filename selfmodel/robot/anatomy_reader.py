"""Reads the anatomy of a robot, and its root body, from its compiled model."""

import math
from collections import Counter
from os.path import commonprefix

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.actuators import ancestors, has_feedback, motor_bodies, motor_joints
from selfmodel.robot.anatomy import Anatomy, Joint, Sensor
from selfmodel.rotation import product, rotated

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


def driven_joints(model: mujoco.MjModel) -> frozenset[int]:
    """Returns the ids of the joints that motors move."""
    return frozenset[int]().union(*(motor_joints(model, m) for m in range(model.nu)))


def joints_of_body(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of the joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def joint_limits(model: mujoco.MjModel, hinge: int) -> tuple[float, float]:
    """Returns the lower and upper angle of a hinge, rad; -pi and pi if it has no limits."""
    if not model.jnt_limited[hinge]:
        return -math.pi, math.pi
    low, high = model.jnt_range[hinge]
    return float(low), float(high)


def reference_pose(model: mujoco.MjModel, body: int) -> tuple[FloatArray, FloatArray]:
    """Returns the reference pose in the world of a body whose ancestors are static.

    It is a position, ``(3,)`` m, and an orientation, ``(4,)``, w x y z.
    """
    position, orientation = model.body_pos[body].copy(), model.body_quat[body].copy()
    for parent in ancestors(model, body)[1:]:
        turn = model.body_quat[parent]
        position = model.body_pos[parent] + rotated(position, turn)
        orientation = product(turn, orientation)
    return position, orientation


def read_anatomy(model: mujoco.MjModel, root: int) -> Anatomy:
    """Returns the named parts of a robot, of a model that ``check_model`` accepts.

    The hinges of one body form one joint if a motor moves at least one of them. The joint has the
    common prefix of their names, or else the name of the body. Touch sensors and joint position
    sensors are the inputs of the controller. The joints of the root body belong to no limb.

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
    group = groups[body]
    subtree = frozenset(b for b in range(body, model.nbody) if body in ancestors(model, b))
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


def _joint_names(model: mujoco.MjModel, groups: dict[int, list[int]]) -> dict[int, str]:
    """Returns the joint name per body: the common prefix of its hinges, or the body's name.

    The prefix of ``front_left_hip_swing`` and ``front_left_hip_lift`` is ``front_left_hip``.
    """
    own = {body: str(model.body(body).name) for body in groups}
    prefixes = {
        # RUF071: of names, not of paths
        body: commonprefix([model.joint(j).name for j in group]).rstrip("_") or own[body]  # noqa: RUF071
        for body, group in groups.items()
    }
    shared = Counter(prefixes.values())
    names = {body: name if shared[name] == 1 else own[body] for body, name in prefixes.items()}
    repeated = [name for name, count in Counter(names.values()).items() if count > 1]
    if repeated:
        raise ValueError(
            f"expected a different name for each joint, got two joints with the name "
            f"{min(repeated)!r}, by the common prefix of their hinges or by their bodies: rename "
            f"their hinges"
        )
    return names


def _sensors(model: mujoco.MjModel, hinges: list[int]) -> tuple[Sensor, ...]:
    touch, angle = [], []
    for s in range(model.nsensor):
        name, target = model.sensor(s).name, int(model.sensor_objid[s])
        if model.sensor_type[s] == mujoco.mjtSensor.mjSENS_TOUCH:
            body = model.body(model.site_bodyid[target]).name
            touch.append(Sensor(name, "touch", body, "", 1.0, 0.0))
        elif model.sensor_type[s] == mujoco.mjtSensor.mjSENS_JOINTPOS and target in hinges:
            low, high = joint_limits(model, target)
            body = model.body(model.jnt_bodyid[target]).name
            hinge = model.joint(target).name
            angle.append(Sensor(name, "angle", body, hinge, (high - low) / 2, (low + high) / 2))
    return tuple(touch + angle)


def find_root_body(model: mujoco.MjModel) -> int:
    """Returns the id of the root body of a robot.

    The root body is the body with a free joint or with slide joints. Without such a body the base
    is fixed, and the root body is the static body that carries all driven joints: of several, the
    one nearest to the joints.

    Raises:
        ValueError: The model has several floating bases; or none, and slide joints on a body of the
            world, or no static body below the world that carries all driven joints.
    """
    floating = floating_bodies(model)
    if len(floating) > 1:
        names = ", ".join(model.body(body).name or f"number {body}" for body in floating)
        raise ValueError(
            f"expected one root body that moves freely, got {names}: keep the robot, and remove "
            f"the other bodies or fix them to the world"
        )
    if floating:
        return floating[0]
    if not driven_joints(model):
        raise ValueError("the motors drive no joint: give the joints of the limbs motors")
    for joint in np.flatnonzero(model.jnt_type != _HINGE):
        body = model.body(model.jnt_bodyid[joint])
        if not model.body_weldid[body.parentid[0]]:
            raise ValueError(
                f"the model needs a root body with a free joint, with slide joints and then at "
                f"most one hinge that no motor moves, or without a joint (its base is fixed), and "
                f"the body {body.name or 'without a name'} has other joints: give the root body a "
                f"<freejoint/>, or only hinges to its parent"
            )
    carrier = common_carrier(model)
    if not carrier:
        raise ValueError(
            "the driven joints are on several bodies of the world, or directly on one, and the "
            "base is fixed: put them into one <body>, which is the root body"
        )
    return carrier


def floating_bodies(model: mujoco.MjModel) -> list[int]:
    """Returns the ids of the bodies that can be a floating base.

    They have a free joint; or else they are bodies of the world with independent slide joints and
    then at most one hinge, and no motor moves them.
    """
    free: list[int] = model.jnt_bodyid[model.jnt_type == _FREE].tolist()
    if free:
        return free
    sliding = []
    for body in np.flatnonzero(model.body_parentid == 0).tolist()[1:]:
        joints = joints_of_body(model, body)
        kinds = model.jnt_type[joints].tolist()
        slides = kinds.count(_SLIDE)
        in_order = kinds in ([_SLIDE] * slides, [_SLIDE] * slides + [_HINGE])
        axes = model.jnt_axis[joints[:slides]]
        if slides and in_order and np.linalg.matrix_rank(axes) == slides:
            sliding += [] if driven_joints(model).intersection(joints) else [body]
    return sliding


def common_carrier(model: mujoco.MjModel) -> int:
    """Returns the id of the static body nearest to the driven joints that carries all of them.

    It is 0, the world, if no other static body does.
    """
    chains = [
        {0}.union(b for b in ancestors(model, int(body))[1:] if not model.body_weldid[b])
        for body in model.jnt_bodyid[list(driven_joints(model))]
    ]
    return max(set.intersection(*chains))
