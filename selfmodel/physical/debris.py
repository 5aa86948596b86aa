"""A limb that fell off: it lies on the ground of the physical robot, where it is in the way."""

import mujoco
import numpy as np

from selfmodel.faults.broken import BROKEN
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.reality_gap import DEBRIS
from selfmodel.robot.robot import Robot

MEMORY = 4 * 2**20
"""Bytes for the contacts of a robot among its debris."""


def lost_limbs(robot: Robot, hidden: Hypothesis) -> tuple[str, ...]:
    """Returns the first body of each limb that falls off, in the hypothesis's order."""
    limbs = []
    for fault in hidden.faults:
        if fault.kind is BROKEN:
            bodies = robot.anatomy.joint(fault.part).bodies
            limbs.append(min(bodies, key=lambda name: int(robot.model.body(name).id)))
    return tuple(limbs)


def add_debris(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> None:
    """Adds a free copy of each limb to the physical robot's model, behind everything else.

    The robot's own limb stays where it is: as a ghost it keeps the layout of what is logged. The
    copy has no motors, tendons and sensors, its joints hang loose, and it collides with the ground,
    the robot and other debris; but not with a part that it overlaps when it falls off, which would
    throw it away.

    Args:
        spec: The model, changed.
        limbs: The first body of each.
    """
    bare = spec.copy()
    for parts in (bare.actuators, bare.sensors, bare.equalities, bare.tendons):
        for part in list(parts):
            bare.delete(part)
    # What is excluded from collisions as it overlaps is found out anew.
    for parts in (bare.excludes, bare.pairs):
        for part in list(parts):
            bare.delete(part)
    for k, limb in enumerate(limbs):
        _add_limb(spec, bare, limb, k)
    spec.memory = max(spec.memory, MEMORY)
    for one, other in _overlapping(spec, limbs):
        spec.add_exclude(bodyname1=one, bodyname2=other)


def _add_limb(spec: mujoco.MjSpec, bare: mujoco.MjSpec, limb: str, number: int) -> None:
    """Adds a free copy of one limb of a robot without motors and sensors."""
    # Every attachment brings materials and meshes of its own, under names of its own.
    prefix = f"{DEBRIS}{number}_"
    spec.worldbody.add_frame().attach_body(bare.copy().body(limb), prefix, "")
    piece = spec.body(prefix + limb)
    for part in (piece, *(p for kind in _NAMED for p in piece.find_all(kind))):
        part.name = part.name.replace(prefix, DEBRIS, 1)
    for joint in list(piece.joints):
        spec.delete(joint)
    piece.add_freejoint(name=DEBRIS + limb)
    felt = 0
    for geom in bare.geoms:
        felt |= int(geom.conaffinity)
    for geom in piece.find_all("geom"):
        if geom.contype or geom.conaffinity:
            geom.contype |= felt
            geom.conaffinity |= felt


_NAMED = ("body", "joint", "geom")


def _overlapping(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> list[tuple[str, str]]:
    """The pairs of bodies, debris and other, that overlap when the limbs fall off."""
    model = spec.compile()
    data = mujoco.MjData(model)
    drop_debris(model, data, limbs)
    mujoco.mj_forward(model, data)
    geoms = data.contact.geom[data.contact.dist < 0]
    pairs = np.unique(np.sort(model.geom_bodyid[geoms], axis=1), axis=0)
    # Debris stands last in the model, and what stands first is the world.
    return [
        (model.body(one).name, model.body(other).name)
        for one, other in pairs
        if one != 0 and model.body(other).name.startswith(DEBRIS)
    ]


def drop_debris(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
    """Puts each piece of debris where the limb is that it is a copy of.

    Args:
        model: A physical robot's, with debris.
        data: Its state, of which the debris's positions are written.
        limbs: The first body of each.
    """
    mujoco.mj_kinematics(model, data)
    for limb in limbs:
        body = data.body(limb)
        data.joint(DEBRIS + limb).qpos[:] = np.concatenate([body.xpos, body.xquat])
    for j in range(model.njnt):
        name = model.joint(j).name
        if name.startswith(DEBRIS) and model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE:
            data.joint(j).qpos[:] = data.joint(name.removeprefix(DEBRIS)).qpos
