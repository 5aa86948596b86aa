"""Rotates a robot about the vertical until its forward direction is the world's x axis."""

import math

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.contacts import contact_pairs
from selfmodel.robot.mjcf.document.body_frames import BodyFrames, write_frames
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.settings import FORWARD_DIRECTIONS, MjcfSettings

_LEVEL_TOLERANCE = 1e-9
"""Largest deviation of the ground's unit normal from the vertical, per component."""


def turn_forward(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Rotates a floating robot until its forward direction is the world's x axis.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.
        settings: Settings with the forward direction.

    Raises:
        InputError: The robot has no free joint, or the rotation would change its world.
    """
    angle = -math.radians(FORWARD_DIRECTIONS[settings.forward])
    if not angle:
        return
    free = mujoco.mjtJoint.mjJNT_FREE
    root = next((j for j in range(model.njnt) if model.jnt_type[j] == free), None)
    if root is None:
        raise InputError(
            f"forward={settings.forward} needs a root body with a free joint, got none: rotate the "
            f"robot in its file, so that x is forward"
        )
    if np.any(model.opt.gravity[:2]) or np.any(model.opt.wind[:2]) or not _is_flat(model):
        raise InputError(
            f"forward={settings.forward} rotates the robot, and its world is not the same from all "
            f"sides: rotate the robot in its file, so that x is forward"
        )
    body = int(model.jnt_bodyid[root])
    frames = BodyFrames.of(model)
    rotation = np.array([math.cos(angle / 2), 0, 0, math.sin(angle / 2)])
    orientation = np.empty(4)
    mujoco.mju_mulQuat(orientation, rotation, frames.orientation[body])
    frames.orientation[body] = orientation
    write_frames(document, model, frames)
    document.notes.append(f"the initial pose is rotated, so that {settings.forward} is forward")


def _is_flat(model: mujoco.MjModel) -> bool:
    """Returns whether all static geoms that can be touched are level planes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    paired = {geom for pair in contact_pairs(model) for geom in pair}
    for geom in range(model.ngeom):
        moves = model.body_weldid[model.geom_bodyid[geom]] != 0
        touched = geom in paired or model.geom_contype[geom] | model.geom_conaffinity[geom]
        if moves or not touched:
            continue
        level = np.allclose(data.geom_xmat[geom, 2::3], (0, 0, 1), rtol=0, atol=_LEVEL_TOLERANCE)
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_PLANE or not level:
            return False
    return True
