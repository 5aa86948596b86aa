"""Rotation into the start frame of a trial, in which the robot heads along +x."""

import numpy as np

from selfmodel.arrays import FloatArray


def heading_removal(orientation: FloatArray) -> FloatArray:
    """Returns the rotation about the vertical after which an orientation heads along +x.

    Args:
        orientation: ``(4,)``, w x y z.

    Returns:
        ``(4,)``, w x y z.
    """
    w, x, y, z = orientation
    half = -np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])


def rotate_world(orientations: FloatArray, rotation: FloatArray) -> FloatArray:
    """Returns orientations after a rotation of the world.

    A matrix product, which rounds differently from ``trials.rotation.product``.

    Args:
        orientations: ``(steps, 4)``, w x y z.
        rotation: ``(4,)``, w x y z.
    """
    w, x, y, z = rotation
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    result: FloatArray = orientations @ matrix.T
    return result
