"""A limb that fell off: it lies on the ground of the physical robot, where it is in the way."""

import mujoco
import numpy as np

from selfmodel.gap import DEBRIS
from selfmodel.hypothesis import Hypothesis
from selfmodel.robot import Robot

MEMORY = 4 * 2**20
"""Bytes for the contacts of a robot among its debris."""


def lost_limbs(robot: Robot, hidden: Hypothesis) -> tuple[str, ...]:
    """Returns the first body of each limb that falls off, in the hypothesis's order."""
    limbs = []
    for fault in hidden.faults:
        if fault.kind == "break":
            bodies = robot.anatomy.joint(fault.part).bodies
            limbs.append(min(bodies, key=lambda name: int(robot.model.body(name).id)))
    return tuple(limbs)


def add_debris(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> None:
    """Adds a free copy of each limb to the physical robot's model, behind everything else.

    The robot's own limb stays where it is: as a ghost it keeps the layout of what is logged. The
    copy has no motors and no sensors, its joints hang loose, and it collides with the ground, the
    robot and other debris; but not with a part that it overlaps when it falls off, which would
    throw it away.

    Args:
        spec: The model, changed.
        limbs: The first body of each.
    """
    nominal = spec.copy()
    for part in (*nominal.actuators, *nominal.sensors):
        nominal.delete(part)
    felt = 0
    for geom in nominal.geoms:
        felt |= int(geom.conaffinity)
    for k, limb in enumerate(limbs):
        # Every attachment brings materials and meshes of its own, under names of its own.
        prefix = f"{DEBRIS}{k}_"
        spec.worldbody.add_frame().attach_body(nominal.copy().body(limb), prefix, "")
        piece = spec.body(prefix + limb)
        for kind in ("body", "joint", "geom"):
            for part in piece.find_all(kind):
                if part.name:
                    part.name = DEBRIS + part.name.removeprefix(prefix)
        piece.name = DEBRIS + limb
        for joint in list(piece.joints):
            spec.delete(joint)
        piece.add_freejoint(name=DEBRIS + limb)
        for geom in piece.find_all("geom"):
            if geom.contype or geom.conaffinity:
                geom.contype |= felt
                geom.conaffinity |= felt
    spec.memory = max(spec.memory, MEMORY)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    drop_debris(model, data, limbs)
    mujoco.mj_forward(model, data)
    overlapping = data.contact.geom[data.contact.dist < 0]
    for pair in np.unique(model.geom_bodyid[overlapping], axis=0):
        names = [model.body(b).name for b in pair]
        if 0 not in pair and any(name.startswith(DEBRIS) for name in names):
            spec.add_exclude(bodyname1=names[0], bodyname2=names[1])


def drop_debris(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
    """Puts each piece of debris where the limb is that it is a copy of.

    Args:
        model: A physical robot's, with debris.
        data: Its state, up to the places of bodies; the debris's positions are written.
        limbs: The first body of each.
    """
    for limb in limbs:
        body = data.body(limb)
        data.joint(DEBRIS + limb).qpos[:] = np.concatenate([body.xpos, body.xquat])
    for j in range(model.njnt):
        name = model.joint(j).name
        if name.startswith(DEBRIS) and model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE:
            data.joint(j).qpos[:] = data.joint(name.removeprefix(DEBRIS)).qpos
