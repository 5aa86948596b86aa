"""Rotations of body frames of a MuJoCo model, with MuJoCo's own functions.

``selfmodel.trials.rotation`` rotates whole behaviours; its results differ in the last bits.
"""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray


def turned_by_hinge(
    position: FloatArray,
    orientation: FloatArray,
    axis: FloatArray,
    anchor: FloatArray,
    angle: float,
) -> tuple[FloatArray, FloatArray]:
    """Returns the frame of a body after a rotation about one of its hinges.

    Args:
        position: Position of the body in its parent's frame, ``(3,)`` m.
        orientation: Orientation of the body in its parent's frame, ``(4,)``, w x y z.
        axis: Axis of the hinge in the body frame, ``(3,)``.
        anchor: Position of the hinge in the body frame, ``(3,)`` m.
        angle: Angle of the rotation, rad.

    Returns:
        The new position, ``(3,)``, and the new orientation, ``(4,)``.
    """
    rotation, rotated = np.empty(4), np.empty(4)
    mujoco.mju_axisAngle2Quat(rotation, axis, angle)
    mujoco.mju_mulQuat(rotated, orientation, rotation)
    before, after = np.empty(3), np.empty(3)
    mujoco.mju_rotVecQuat(before, anchor, orientation)
    mujoco.mju_rotVecQuat(after, anchor, rotated)
    return position + (before - after), rotated


def turn_about_origin(position: FloatArray, orientation: FloatArray, rotation: FloatArray) -> None:
    """Rotates a frame about the origin of its parent frame, in place.

    Args:
        position: Position of the frame, ``(3,)`` m; written.
        orientation: Orientation of the frame, ``(4,)``, w x y z; written.
        rotation: The rotation, ``(4,)``, w x y z.
    """
    mujoco.mju_rotVecQuat(position, position.copy(), rotation)
    mujoco.mju_mulQuat(orientation, rotation, orientation.copy())
