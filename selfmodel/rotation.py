"""Rotations as unit quaternions, w x y z."""

import numpy as np

from selfmodel.arrays import FloatArray


def rotation_between(to: FloatArray, start: FloatArray) -> FloatArray:
    """Returns the rotation from one orientation to another, as a small rotation vector.

    It is twice the vector part of the rotation in the frame of ``start``, ``(..., 3)``: axis times
    angle, rad, for small angles; its norm is at most 2. The shape of ``start`` broadcasts to that
    of ``to``.
    """
    w, v = start[..., :1], start[..., 1:]
    scalar = (to * start).sum(axis=-1, keepdims=True)
    vector = w * to[..., 1:] - to[..., :1] * v - cross(v, to[..., 1:])
    return np.asarray(2 * vector * np.where(scalar < 0, -1.0, 1.0))


def directions(orientation: FloatArray) -> FloatArray:
    """Returns the heading and the tilt of a body as direction cosines, ``(..., 5)``.

    They are the horizontal components of the body's x axis in the world frame, then the world's
    upward direction in the body frame: the same for a quaternion and its negative.
    """
    w, x, y, z = np.moveaxis(orientation, -1, 0)
    forward = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z))
    upward = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    return np.stack([*forward, *upward], axis=-1)


def headings(orientation: FloatArray) -> FloatArray:
    """Returns the angle of a body's x axis in the horizontal plane, rad, ``(...)``."""
    ahead = directions(orientation)
    return np.asarray(np.arctan2(ahead[..., 1], ahead[..., 0]))


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Returns the quaternion product, ``(..., 4)``: the second rotation followed by the first.

    The second one's shape broadcasts to that of the first.
    """
    scalar, axis = first[..., :1], first[..., 1:]
    second_scalar, second_axis = second[..., :1], second[..., 1:]
    real = scalar * second_scalar - (axis * second_axis).sum(axis=-1, keepdims=True)
    vector = scalar * second_axis + second_scalar * axis + cross(axis, second_axis)
    return np.concatenate([real, vector], axis=-1)


def rotated(vectors: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns vectors, ``(..., 3)``, rotated from the body frame to the world frame."""
    twice = 2 * cross(orientation[..., 1:], vectors)
    return np.asarray(vectors + orientation[..., :1] * twice + cross(orientation[..., 1:], twice))


def in_body_frame(vectors: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns vectors, ``(..., 3)``, rotated from the world frame to the body frame."""
    inverse = np.concatenate([orientation[..., :1], -orientation[..., 1:]], axis=-1)
    return rotated(vectors, inverse)


def cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Returns cross products, bit-identical to ``numpy.cross`` in half of its time.

    The pose of a planar body needs two cross products per control step.
    """
    a, b, c = (first[..., i] for i in range(3))
    x, y, z = (second[..., i] for i in range(3))
    result = np.empty(np.broadcast_shapes(first.shape, second.shape))
    np.subtract(b * z, c * y, out=result[..., 0])
    np.subtract(c * x, a * z, out=result[..., 1])
    np.subtract(a * y, b * x, out=result[..., 2])
    return result
