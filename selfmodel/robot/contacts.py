"""Possible contacts of a model: which geoms can touch which, by their masks and explicit pairs."""

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, IndexArray


def contacts_enabled(model: mujoco.MjModel) -> bool:
    """Returns whether contacts are simulated; a swimmer may disable them."""
    disable = mujoco.mjtDisableBit
    return not model.opt.disableflags & (disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT)


def touching_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom can touch anything, by a mask or a ``<pair>``, ``(ngeom,)``."""
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    touching[model.pair_geom1] = touching[model.pair_geom2] = True
    return np.asarray(touching)


def can_touch(model: mujoco.MjModel, geoms: BoolArray | IndexArray) -> BoolArray:
    """Returns whether the mask of each geom lets it touch one of some geoms, ``(ngeom,)``."""
    contype, conaffinity = (
        np.bitwise_or.reduce(mask[geoms], initial=0)
        for mask in (model.geom_contype, model.geom_conaffinity)
    )
    touching = (model.geom_contype & conaffinity) | (model.geom_conaffinity & contype)
    return np.asarray(touching != 0)


def static_geoms(model: mujoco.MjModel) -> BoolArray:
    """Returns whether each geom belongs to the world or is fixed to it, ``(ngeom,)``."""
    return np.asarray(model.body_weldid[model.geom_bodyid] == 0)


def ground_contact_geoms(model: mujoco.MjModel) -> list[int]:
    """Returns the ids of the moving geoms that can touch a static geom."""
    static = static_geoms(model)
    touching = can_touch(model, static)
    for geoms, others in (
        (model.pair_geom1, model.pair_geom2),
        (model.pair_geom2, model.pair_geom1),
    ):
        touching[geoms[static[others]]] = True
    ids: list[int] = np.flatnonzero(touching & ~static).tolist()
    return ids
