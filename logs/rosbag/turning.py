"""Turning vectors and orientations, and the frame in which a trial begins."""

import numpy as np

from selfmodel.arrays import FloatArray


def rotated(vectors: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Returns vectors, as seen from outside, that were told in a turned frame.

    Args:
        vectors: ``(steps, 3)``.
        quaternions: ``(steps, 4)`` or ``(1, 4)``, unit, w x y z: how the frame is turned.
    """
    scalar, axis = quaternions[:, :1], quaternions[:, 1:]
    twice = 2 * np.cross(axis, vectors)
    result: FloatArray = vectors + scalar * twice + np.cross(axis, twice)
    return result


def turned(quaternions: FloatArray, by: FloatArray) -> FloatArray:
    """Returns orientations after the world was turned.

    Args:
        quaternions: ``(steps, 4)``, w x y z.
        by: ``(4,)``, w x y z.
    """
    w, x, y, z = by
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    result: FloatArray = quaternions @ matrix.T
    return result


def unyaw(quaternion: FloatArray) -> FloatArray:
    """Returns the turn about the vertical that makes an orientation head along +x.

    Args:
        quaternion: ``(4,)``, w x y z.

    Returns:
        ``(4,)``, w x y z.
    """
    w, x, y, z = quaternion
    half = -np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
