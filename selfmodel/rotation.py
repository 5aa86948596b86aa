"""Rotations as unit quaternions, w x y z."""

import numpy as np

from selfmodel.arrays import FloatArray


def rotation_between(to: FloatArray, start: FloatArray) -> FloatArray:
    """Returns by how much one orientation is turned from another.

    Args:
        to: ``(..., 4)``.
        start: ``(..., 4)``, of a shape that broadcasts to that of ``to``.

    Returns:
        ``(..., 3)`` twice the vector part of the rotation in the frame of ``start``: its axis times
        its angle, rad, as long as the angle is small, and at most 2 long.
    """
    w, v = start[..., :1], start[..., 1:]
    scalar = (to * start).sum(axis=-1, keepdims=True)
    vector = w * to[..., 1:] - to[..., :1] * v - np.cross(v, to[..., 1:])
    return np.asarray(2 * vector * np.where(scalar < 0, -1.0, 1.0))
