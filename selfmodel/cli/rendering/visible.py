"""The geoms of a model that a picture shows: of every body the visual ones, or else all."""

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray

VISUAL_GROUPS = 3
"""Groups 0, 1 and 2 are drawn by MuJoCo's viewer; Menagerie has collision geoms in group 3."""

_DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that leaves the colour to its material."""


def visible_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom is drawn, ``(ngeom,)``.

    The geoms of a body in the visual groups are drawn if there are any; a body without them is
    drawn with its other geoms. If a body has colliding geoms in one visual group and
    meshes without contacts in another, only the meshes are drawn.
    """
    seen = (model.geom_group < VISUAL_GROUPS) & (opacity(model) > 0)
    seen &= ~_covered(model, seen)
    bare = np.ones(model.nbody, dtype=bool)
    bare[model.geom_bodyid[seen]] = False
    return np.asarray(seen | bare[model.geom_bodyid])


def colliding_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom has a contact mask or a contact pair, ``(ngeom,)``."""
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    collides[model.pair_geom1] = True
    collides[model.pair_geom2] = True
    return np.asarray(collides)


def opacity(model: mujoco.MjModel) -> FloatArray:
    """Returns the opacity of each geom, of its own colour or of its material, ``(ngeom,)``."""
    own = model.geom_rgba[:, 3].astype(float)
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == _DEFAULT_RGBA).all(axis=1)
    own[by_material] = model.mat_rgba[model.geom_matid[by_material], 3]
    return own


def _covered(model: mujoco.MjModel, seen: BoolArray) -> BoolArray:
    """Returns whether each geom is the collision geom of a body with a mesh to be drawn instead."""
    collides = colliding_geoms(model)
    covered = np.zeros(model.ngeom, dtype=bool)
    meshes = (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~collides
    for geom in np.flatnonzero(meshes & seen):
        same_body = model.geom_bodyid == model.geom_bodyid[geom]
        covered |= same_body & collides & (model.geom_group != model.geom_group[geom])
    return covered
