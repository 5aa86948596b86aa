"""The initial pose of a robot from a URDF: joint angles, the height of the base, and contacts."""

from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.robot.contacts import ground_contact_geoms
from selfmodel.robot.mjcf.joint_values import JointValues, value_of
from selfmodel.robot.mjcf.placement.ground import lowest_point


@dataclass(frozen=True)
class Stance:
    """An initial pose.

    Attributes:
        qpos: ``(nq,)``, with the lowest colliding geom at height 0 if the base is free.
        overlapping: Names of the pairs of bodies that overlap in the pose.
    """

    qpos: FloatArray
    overlapping: list[tuple[str, str]]


def stance(model: mujoco.MjModel, pose: JointValues) -> Stance:
    """Returns the initial pose of a robot.

    Args:
        model: The model; if its base is free, geom 0 is a horizontal plane at height 0.
        pose: Angles of joints by name or pattern, rad; of the others, the angle of the range that
            is nearest to 0.

    Raises:
        InputError: An angle is outside the range of its joint.
    """
    data = mujoco.MjData(model)
    for j in range(model.njnt):
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE:
            data.qpos[model.jnt_qposadr[j]] = _angle(model, j, pose)
    _follow_couplings(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if len(free) and ground_contact_geoms(model):
        data.qpos[model.jnt_qposadr[free[0]] + 2] -= lowest_point(model, data)
        mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return Stance(data.qpos.copy(), _overlapping(model, data))


def _angle(model: mujoco.MjModel, joint: int, pose: JointValues) -> float:
    name = model.joint(joint).name
    low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
    angle = value_of(pose, name)
    if angle is None:
        return float(np.clip(0.0, low, high))
    if not low <= angle <= high:
        raise InputError(
            f"pose has {angle:g} rad for the joint {name}, outside its range of {low:.4g} to "
            f"{high:.4g} rad"
        )
    return angle


def _follow_couplings(model: mujoco.MjModel, qpos: FloatArray) -> None:
    """Moves the joints that mimic another joint, whatever the order of the couplings."""
    followers, leaders = (
        model.jnt_qposadr[joints] for joints in (model.eq_obj1id, model.eq_obj2id)
    )
    for _ in range(model.neq):  # a chain of couplings has at most as many links
        angles = model.eq_data[:, 0] + model.eq_data[:, 1] * qpos[leaders]
        if np.array_equal(qpos[followers], angles):
            return
        qpos[followers] = angles


def _overlapping(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[str, str]]:
    pairs = set()
    for contact in data.contact[: data.ncon]:
        first, second = sorted(int(model.geom_bodyid[geom]) for geom in contact.geom)
        if first and contact.dist < 0:
            pairs.add((first, second))
    return [(model.body(first).name, model.body(second).name) for first, second in sorted(pairs)]
