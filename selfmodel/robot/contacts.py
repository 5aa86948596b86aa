"""Possible contacts of a model: the geoms that can touch static geoms."""

import mujoco
import numpy as np


def contacts_enabled(model: mujoco.MjModel) -> bool:
    """Returns whether contacts are simulated; a swimmer may disable them."""
    disable = mujoco.mjtDisableBit
    return not model.opt.disableflags & (disable.mjDSBL_CONTACT | disable.mjDSBL_CONSTRAINT)


def ground_contact_geoms(model: mujoco.MjModel) -> list[int]:
    """Returns the ids of the moving geoms that can touch a static geom."""
    moves = model.body_weldid[model.geom_bodyid] != 0
    contype, conaffinity = (
        joined_mask(mask[~moves]) for mask in (model.geom_contype, model.geom_conaffinity)
    )
    paired = {
        first
        for pair in contact_pairs(model)
        for first, second in (pair, pair[::-1])
        if moves[first] and not moves[second]
    }
    moving = map(int, np.flatnonzero(moves))
    return [
        geom for geom in moving if geom in paired or _can_touch(model, geom, contype, conaffinity)
    ]


def contact_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Returns the ids of the geoms of each explicit ``<pair>``, to which masks do not apply."""
    return list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))


def joined_mask(masks: np.ndarray) -> int:
    """Returns the bitwise or of contact masks; 0 for no masks."""
    return int(np.bitwise_or.reduce(masks, initial=0))


def _can_touch(model: mujoco.MjModel, geom: int, contype: int, conaffinity: int) -> bool:
    """Returns whether a geom can touch a geom with these two masks."""
    own = int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])
    return bool(own[0] & conaffinity or own[1] & contype)
