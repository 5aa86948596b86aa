"""Convex hulls in place of the meshes of an MJCF."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray

DRAWN_POINTS = 60
"""Largest number of points of a hull that is only drawn."""

_FLATNESS = 1e-3
"""Smallest thickness of a hull that is only drawn, as a fraction of its length."""

_ATTRIBUTES = {"scale": "1 1 1", "refpos": "0 0 0", "refquat": "1 0 0 0", "inertia": "convex"}


def drawn_hull(model: mujoco.MjModel, mesh: int) -> FloatArray:
    """Returns points of a mesh with about the same convex hull, ``(points, 3)``, m.

    They are the outermost points in ``DRAWN_POINTS`` directions. A flat mesh gets a thickness,
    because MuJoCo refuses meshes without volume.
    """
    points = mesh_points(model, mesh)
    outermost = np.unique(np.argmax(points @ directions(DRAWN_POINTS).T, axis=0))
    outer: FloatArray = points[outermost]
    _, extent, axes = np.linalg.svd(outer - outer.mean(axis=0), full_matrices=False)
    if len(extent) == 3 and extent[2] >= _FLATNESS * extent[0]:
        return outer
    length = max(float(np.ptp(points, axis=0).max()), _FLATNESS)
    thickness = _FLATNESS * length * np.concatenate([axes, np.eye(3)])
    return np.concatenate([outer + shift for shift in (*thickness, *-thickness)])


def colliding_hull(model: mujoco.MjModel, mesh: int) -> FloatArray | None:
    """Returns the points of the convex hull that MuJoCo collides with, ``(points, 3)``, m.

    None if MuJoCo has computed no hull for the mesh.
    """
    start = int(model.mesh_graphadr[mesh])
    if start < 0:
        return None
    count = int(model.mesh_graph[start])
    # A graph is: points, faces, then per point the address of its edges, then its vertex.
    used = model.mesh_graph[start + 2 + count : start + 2 + 2 * count]
    return np.asarray(mesh_points(model, mesh)[used])


def mesh_points(model: mujoco.MjModel, mesh: int) -> FloatArray:
    """Returns the vertices of a mesh in the frame of its file, scaled, ``(points, 3)``, m."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[mesh])
    points = model.mesh_vert[first : first + count].astype(float)
    return np.asarray(points @ rotation.reshape(3, 3).T + model.mesh_pos[mesh])


def directions(count: int) -> FloatArray:
    """Returns unit vectors that are spread evenly on a sphere (a Fibonacci lattice)."""
    number = np.arange(count) + 0.5
    height, angle = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def write_hull(element: ET.Element, points: FloatArray, digits: int) -> None:
    """Makes a ``<mesh>`` the convex hull of points, without a file.

    Args:
        element: The ``<mesh>``, edited in place.
        points: The points, ``(points, 3)``, m.
        digits: Significant digits of the text.
    """
    name = element.get("name", "")
    element.clear()
    vertices = " ".join(f"{value:.{digits}g}" for value in points.ravel())
    element.attrib.update({"name": name, **_ATTRIBUTES, "vertex": vertices})
