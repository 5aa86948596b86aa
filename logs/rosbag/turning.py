"""Rotation of vectors and orientations, and the initial frame of a trial."""

import numpy as np

from selfmodel.arrays import FloatArray


def rotated(vectors: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Returns vectors of a rotated frame in the parent frame.

    Args:
        vectors: Vectors, ``(steps, 3)``.
        quaternions: Unit quaternions of the frame, ``(steps, 4)`` or ``(1, 4)``, w x y z.
    """
    scalar, axis = quaternions[:, :1], quaternions[:, 1:]
    twice = 2 * np.cross(axis, vectors)
    result: FloatArray = vectors + scalar * twice + np.cross(axis, twice)
    return result


def turned(quaternions: FloatArray, by: FloatArray) -> FloatArray:
    """Returns orientations after a rotation of the world.

    Args:
        quaternions: Orientations, ``(steps, 4)``, w x y z.
        by: Rotation, ``(4,)``, w x y z.
    """
    w, x, y, z = by
    matrix = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    result: FloatArray = quaternions @ matrix.T
    return result


def unyaw(quaternion: FloatArray) -> FloatArray:
    """Returns the rotation about the vertical that turns a heading to +x.

    Args:
        quaternion: Orientation, ``(4,)``, w x y z.

    Returns:
        Rotation, ``(4,)``, w x y z.
    """
    w, x, y, z = quaternion
    half = -np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
