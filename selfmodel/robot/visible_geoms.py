"""The geoms of a model that a picture shows: a choice for each body, so that the robot is seen."""

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray

VISUAL_GROUPS = 3
"""Groups 0, 1 and 2 are drawn by MuJoCo's viewer; Menagerie has collision geoms in group 3."""

DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that leaves the colour to its material."""

_ENOUGH = 0.5
"""Smallest size of the chosen geoms of a body, as a fraction of the size of all of them."""


def visible_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom is drawn, ``(ngeom,)``.

    The geoms of a body in the visual groups are drawn, without those for contacts if there are
    visual meshes in another group. All geoms of a body are drawn if these are less than half as
    large as the body: a limb without visual geoms, or a head of which only the eyes would be seen.
    """
    seen = (model.geom_group < VISUAL_GROUPS) & (opacity(model) > 0)
    return _or_whole_bodies(model, seen & ~_covered(model, seen))


def stick_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom is drawn in a stick figure, ``(ngeom,)``.

    A mesh, whose bounding box would be drawn, is left out if the body has other geoms.
    """
    return _or_whole_bodies(model, model.geom_type != mujoco.mjtGeom.mjGEOM_MESH)


def opacity(model: mujoco.MjModel) -> FloatArray:
    """Returns the opacity of each geom, of its own colour or of its material, ``(ngeom,)``."""
    own: FloatArray = model.geom_rgba[:, 3].astype(float)
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == DEFAULT_RGBA).all(axis=1)
    own[by_material] = model.mat_rgba[model.geom_matid[by_material], 3]
    return own


def _or_whole_bodies(model: mujoco.MjModel, chosen: BoolArray) -> BoolArray:
    """Returns the chosen geoms, and all geoms of bodies with too few of them."""
    size = np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
    size[model.geom_rbound == 0] = np.inf  # a plane
    whole, part = np.zeros(model.nbody), np.full(model.nbody, -1.0)
    np.maximum.at(whole, model.geom_bodyid, size)
    np.maximum.at(part, model.geom_bodyid[chosen], size[chosen])
    return np.asarray(chosen | (part < _ENOUGH * whole)[model.geom_bodyid])


def _covered(model: mujoco.MjModel, seen: BoolArray) -> BoolArray:
    """Returns whether each geom is the collision geom of a body with a mesh to be drawn instead."""
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    collides[model.pair_geom1] = True
    collides[model.pair_geom2] = True
    covered = np.zeros(model.ngeom, dtype=bool)
    meshes = (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~collides
    for geom in np.flatnonzero(meshes & seen):
        same_body = model.geom_bodyid == model.geom_bodyid[geom]
        covered |= same_body & collides & (model.geom_group != model.geom_group[geom])
    return covered
