"""Rotation into the start frame of a trial, in which the robot heads along +x."""

import numpy as np

from selfmodel.arrays import FloatArray


def rotate_world(quaternions: FloatArray, rotation: FloatArray) -> FloatArray:
    """Returns orientations after a rotation of the world.

    A matrix product, which rounds differently from ``trials.rotation.product``.

    Args:
        quaternions: Orientations, ``(steps, 4)``, w x y z.
        rotation: Rotation, ``(4,)``, w x y z.
    """
    w, x, y, z = rotation
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    result: FloatArray = quaternions @ matrix.T
    return result


def heading_removal(quaternion: FloatArray) -> FloatArray:
    """Returns the rotation about the vertical that turns a heading to +x.

    Args:
        quaternion: Orientation, ``(4,)``, w x y z.

    Returns:
        Rotation, ``(4,)``, w x y z.
    """
    w, x, y, z = quaternion
    half = -np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
