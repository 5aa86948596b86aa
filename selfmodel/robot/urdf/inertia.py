"""Masses and inertias of the links of a URDF as MJCF."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.document.expand import format_numbers
from selfmodel.robot.urdf.frame import Frame, placed


def inertial(body: mujoco.MjsBody) -> dict[str, str]:
    """Returns the attributes of an ``<inertial>``."""
    mass = {"mass": repr(float(body.mass))}
    full = _moments(body)
    if not is_rigid(body):
        full = np.array([*np.full(3, max(0.0, float(full[:3].mean()))), 0.0, 0.0, 0.0])
    if not np.any(full[3:]):
        frame = Frame(np.array(body.ipos), np.array(body.iquat))
        return placed(frame) | mass | {"diaginertia": format_numbers(full[:3])}
    # MJCF has no orientation beside a full inertia.
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(body.iquat))
    turn = rotation.reshape(3, 3)
    matrix = turn @ _inertia_matrix(body) @ turn.T
    elements = matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return {
        "pos": format_numbers(np.array(body.ipos)),
        "fullinertia": format_numbers(elements),
    } | mass


def is_rigid(body: mujoco.MjsBody) -> bool:
    """Returns whether the inertia of a body is that of a rigid body, or zero."""
    matrix = _inertia_matrix(body)
    if not np.any(matrix):
        return True
    least, middle, most = np.linalg.eigvalsh(matrix)
    return bool(least > 0 and least + middle >= most)


def _inertia_matrix(body: mujoco.MjsBody) -> FloatArray:
    """Returns the inertia of a body in its inertial frame, ``(3, 3)`` kg m²."""
    xx, yy, zz, xy, xz, yz = _moments(body)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _moments(body: mujoco.MjsBody) -> FloatArray:
    """Returns the moments and products of inertia, ``(6,)`` kg m²; 0 if the URDF has none."""
    moments: FloatArray = np.nan_to_num(np.array(body.fullinertia, float))
    return moments
