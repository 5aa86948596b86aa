"""Debris of a physical robot: free copies of its detached limbs."""

import mujoco
import numpy as np

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.joints import BROKEN
from selfmodel.physical.reality_gap import DEBRIS_PREFIX
from selfmodel.robot.robot import Robot

CONTACT_MEMORY = 4 * 2**20
"""Size of MuJoCo's arena for the contacts of a robot with its debris, bytes."""


def detached_limbs(robot: Robot, hidden: Hypothesis) -> tuple[str, ...]:
    """Returns the root body of each limb that a hypothesis detaches, in the order of its faults."""
    limbs = []
    for fault in hidden.faults:
        if fault.kind is BROKEN:
            bodies = robot.anatomy.joint(fault.part).bodies
            limbs.append(min(bodies, key=lambda name: int(robot.model.body(name).id)))
    return tuple(limbs)


def add_debris(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> None:
    """Adds a free copy of each limb to a physical robot's model, after all other bodies.

    The robot's own limb remains as a detached body, so that the layout of the logged signals is
    unchanged. The copy has no motors, tendons and sensors, and its joints are free. The copy
    collides with the ground, the robot and other debris, but not with a body that it overlaps at
    the start: the contact force would throw the copy away.

    Args:
        spec: The model; it is changed.
        limbs: Root body of each limb.
    """
    bare = spec.copy()
    for parts in (bare.actuators, bare.sensors, bare.equalities, bare.tendons):
        for part in list(parts):
            bare.delete(part)
    # _overlapping_pairs computes the excluded pairs anew.
    for parts in (bare.excludes, bare.pairs):
        for part in list(parts):
            bare.delete(part)
    for k, limb in enumerate(limbs):
        _add_limb(spec, bare, limb, k)
    spec.memory = max(spec.memory, CONTACT_MEMORY)
    for first, second in _overlapping_pairs(spec, limbs):
        spec.add_exclude(bodyname1=first, bodyname2=second)


def _add_limb(spec: mujoco.MjSpec, bare: mujoco.MjSpec, limb: str, number: int) -> None:
    """Adds a free copy of a limb, taken from a robot without motors and sensors."""
    # Every attachment has copies of its materials and meshes: a prefix per limb keeps them apart.
    prefix = f"{DEBRIS_PREFIX}{number}_"
    spec.worldbody.add_frame().attach_body(bare.copy().body(limb), prefix, "")
    root = spec.body(prefix + limb)
    for part in (root, *(p for kind in _RENAMED_ELEMENTS for p in root.find_all(kind))):
        part.name = part.name.replace(prefix, DEBRIS_PREFIX, 1)
    for joint in list(root.joints):
        spec.delete(joint)
    root.add_freejoint(name=DEBRIS_PREFIX + limb)
    affinities = 0
    for geom in bare.geoms:
        affinities |= int(geom.conaffinity)
    for geom in root.find_all("geom"):
        if geom.contype or geom.conaffinity:
            geom.contype |= affinities
            geom.conaffinity |= affinities


_RENAMED_ELEMENTS = ("body", "joint", "geom")


def _overlapping_pairs(spec: mujoco.MjSpec, limbs: tuple[str, ...]) -> list[tuple[str, str]]:
    """Returns the pairs of a body and a debris body that overlap when the limbs are detached."""
    model = spec.compile()
    data = mujoco.MjData(model)
    place_debris(model, data, limbs)
    mujoco.mj_forward(model, data)
    geoms = data.contact.geom[data.contact.dist < 0]
    pairs = np.unique(np.sort(model.geom_bodyid[geoms], axis=1), axis=0)
    # Debris has the highest body numbers, so the second of a pair; the world is body 0.
    return [
        (model.body(first).name, model.body(second).name)
        for first, second in pairs
        if first != 0 and model.body(second).name.startswith(DEBRIS_PREFIX)
    ]


def place_debris(model: mujoco.MjModel, data: mujoco.MjData, limbs: tuple[str, ...]) -> None:
    """Sets the pose of each debris body to the pose of the limb that the body is a copy of.

    Args:
        model: Model of a physical robot with debris.
        data: State of the model; the positions of the debris are written.
        limbs: Root body of each limb.
    """
    mujoco.mj_kinematics(model, data)
    for limb in limbs:
        body = data.body(limb)
        data.joint(DEBRIS_PREFIX + limb).qpos[:] = np.concatenate([body.xpos, body.xquat])
    for j in range(model.njnt):
        name = model.joint(j).name
        if name.startswith(DEBRIS_PREFIX) and model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE:
            data.joint(j).qpos[:] = data.joint(name.removeprefix(DEBRIS_PREFIX)).qpos
