"""Geoms of MuJoCo as shapes of Rerun."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.cli.viewing.rerun_view import import_rerun

GEOM = mujoco.mjtGeom

Colour = tuple[int, int, int, int]

NOT_DRAWN = (GEOM.mjGEOM_PLANE, GEOM.mjGEOM_HFIELD)
"""Ground, which the view draws as a grid."""


def shape_of(model: mujoco.MjModel, geom: int, colour: Colour, *, transparent: bool) -> Any | None:  # noqa: ANN401  # one of several archetypes
    """Returns a geom in the frame of its body as an archetype of Rerun; None for the ground.

    A geom that is no box, sphere, ellipsoid, capsule, cylinder or mesh is its bounding box.

    Args:
        model: Model of the geom.
        geom: Id of the geom.
        colour: Red, green, blue and opacity, 0 to 255.
        transparent: Whether faces are transparent and edges drawn; a mesh always has faces.
    """
    kind = GEOM(int(model.geom_type[geom]))
    if kind in NOT_DRAWN:
        return None
    rr = import_rerun()
    modes = rr.components.FillMode
    placed = _Placed(
        model,
        geom,
        model.geom_pos[geom],
        _matrix(model.geom_quat[geom]),
        {
            "colors": [colour],
            "fill_mode": modes.TransparentFillMajorWireframe if transparent else modes.Solid,
            "quaternions": [xyzw(model.geom_quat[geom])],
        },
    )
    return SHAPES.get(kind, _bounding_box)(rr, placed)


def xyzw(quaternions: FloatArray) -> FloatArray:
    """Returns quaternions of MuJoCo, ``(..., 4)`` with w first, in Rerun's order, w last."""
    return np.roll(quaternions, -1, axis=-1)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A geom, its pose in the frame of its body, and how it looks."""

    model: mujoco.MjModel
    geom: int
    place: FloatArray
    turn: FloatArray
    look: Mapping[str, Any]

    @property
    def size(self) -> FloatArray:
        """Sizes of the geom, ``(3,)``, m: their meaning depends on its type."""
        found: FloatArray = self.model.geom_size[self.geom]
        return found


def _capsule(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    radius, half = one.size[:2]
    # A capsule of Rerun begins at its origin; MuJoCo's has the origin in the middle.
    start = one.place - one.turn @ np.array([0.0, 0.0, half])
    return rr.Capsules3D(lengths=[2 * half], radii=[radius], translations=[start], **one.look)


def _cylinder(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    radius, half = one.size[:2]
    return rr.Cylinders3D(lengths=[2 * half], radii=[radius], centers=[one.place], **one.look)


def _sphere(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    radii = np.repeat(one.size[0], 3)
    return rr.Ellipsoids3D(half_sizes=[radii], centers=[one.place], **one.look)


def _ellipsoid(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    return rr.Ellipsoids3D(half_sizes=[one.size], centers=[one.place], **one.look)


def _box(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    return rr.Boxes3D(half_sizes=[one.size], centers=[one.place], **one.look)


def _bounding_box(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    middle, reach = one.model.geom_aabb[one.geom, :3], one.model.geom_aabb[one.geom, 3:]
    return rr.Boxes3D(half_sizes=[reach], centers=[one.place + one.turn @ middle], **one.look)


def _mesh(rr: Any, one: _Placed) -> Any:  # noqa: ANN401  # Rerun
    model, mesh = one.model, int(one.model.geom_dataid[one.geom])
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    return rr.Mesh3D(
        vertex_positions=vertices @ one.turn.T + one.place,
        triangle_indices=model.mesh_face[face : face + int(model.mesh_facenum[mesh])],
        albedo_factor=one.look["colors"][0],
    )


SHAPES: Mapping[mujoco.mjtGeom, Callable[[Any, _Placed], Any]] = MappingProxyType(
    {
        GEOM.mjGEOM_CAPSULE: _capsule,
        GEOM.mjGEOM_CYLINDER: _cylinder,
        GEOM.mjGEOM_SPHERE: _sphere,
        GEOM.mjGEOM_ELLIPSOID: _ellipsoid,
        GEOM.mjGEOM_BOX: _box,
        GEOM.mjGEOM_MESH: _mesh,
    }
)


def _matrix(quaternion: FloatArray) -> FloatArray:
    """Returns the rotation of a quaternion with w first, ``(3, 3)``."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
