"""Triangles of a mesh, simplified to what a page can carry."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray

FINEST_GRID = 64
"""Cells along the longest side of a mesh in the first simplification."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface.

    Attributes:
        vertices: Positions, ``(vertices, 3)``, m.
        faces: Indices of the corners of each triangle, ``(faces, 3)``.
    """

    vertices: FloatArray
    faces: IndexArray


def simplified(mesh: Triangles, most_faces: int) -> Triangles:
    """Returns a mesh with at most that many triangles.

    Vertices in one cell of a grid become one, at their mean; the grid is coarsened until the rest
    is small enough. A mesh that is small enough is returned as it is.

    Source: Rossignac & Borrel, "Multi-resolution 3D approximations for rendering complex scenes"
    (1993).

    Args:
        mesh: The mesh.
        most_faces: Largest number of triangles, at least 200.
    """
    found, cells = mesh, FINEST_GRID
    while len(found.faces) > most_faces and cells >= 1:
        found, cells = _clustered(mesh, cells), cells * 3 // 4
    return found


def _clustered(mesh: Triangles, cells: int) -> Triangles:
    low = mesh.vertices.min(axis=0)
    size = float(np.ptp(mesh.vertices, axis=0).max()) / cells or 1.0
    keys = np.floor((mesh.vertices - low) / size).astype(np.int64)
    _, cluster = np.unique(keys, axis=0, return_inverse=True)
    cluster = cluster.reshape(-1)
    counts = np.bincount(cluster)
    means = [np.bincount(cluster, weights=column) / counts for column in mesh.vertices.T]
    faces = np.sort(cluster[mesh.faces], axis=1)
    corners = cluster[mesh.faces]
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
    _, first = np.unique(faces[proper], axis=0, return_index=True)
    return Triangles(np.stack(means, axis=1), corners[proper][np.sort(first)])
