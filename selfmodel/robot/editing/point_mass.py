"""Adds a point mass to a body of a compiled model."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray


def add_point_mass(model: mujoco.MjModel, name: str, mass: float, offset: FloatArray) -> None:
    """Adds a point mass to a body.

    Args:
        model: The model, edited in place; its layout stays.
        name: Name of the body.
        mass: The mass, kg.
        offset: Position of the mass relative to the body's centre of mass, in the frame of the
            body, ``(3,)``, m; with zeros, the inertia is unchanged to the bit.
    """
    body = model.body(name)
    own = float(body.mass[0])
    body.mass = own + mass
    if not offset.any():
        return
    axes = _matrix(body.iquat)
    # About the common centre of mass, two masses have the inertia of the reduced mass.
    reduced = own * mass / (own + mass)
    inertia = axes @ np.diag(body.inertia) @ axes.T
    inertia += reduced * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    moments, vectors = np.linalg.eigh(inertia)
    vectors[:, 0] *= np.linalg.det(vectors)  # a rotation, not a reflection
    mujoco.mju_mat2Quat(body.iquat, vectors.ravel())
    body.inertia = moments
    body.ipos = body.ipos + offset * mass / (own + mass)


def inertia_box_reach(model: mujoco.MjModel, name: str, direction: FloatArray) -> float:
    """Returns the distance of a body's surface from its centre of mass along a direction, m.

    The body is the box of even density with its mass and inertia.

    Args:
        model: A compiled model.
        name: Name of the body.
        direction: Unit vector in the frame of the body, ``(3,)``.
    """
    body = model.body(name)
    moments = np.asarray(body.inertia)
    squares = 6 * np.maximum(moments.sum() - 2 * moments, 0.0) / float(body.mass[0])
    return float(np.abs(_matrix(body.iquat).T @ direction) @ np.sqrt(squares)) / 2


def _matrix(quaternion: FloatArray) -> FloatArray:
    """Returns the rotation matrix of a quaternion w x y z, ``(3, 3)``."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
