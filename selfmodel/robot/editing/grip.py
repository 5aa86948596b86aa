"""Sliding friction of single geoms of a compiled model, whatever they touch."""

import mujoco
import numpy as np

from selfmodel.arrays import IndexArray

_MIN_MIX = 1e-15
"""Smallest weight of a geom in the mean of contact parameters (MuJoCo's ``mjMINVAL``)."""


def scale_grip(model: mujoco.MjModel, bodies: IndexArray, factor: float) -> None:
    """Scales the sliding friction of all contacts of some bodies.

    A contact has the larger friction of its two geoms, so that less friction of one geom alone has
    no effect. The geoms of the bodies get a higher priority than all other geoms: a contact then
    has the parameters of the geom with the higher priority. The parameters that they had in a
    contact with the ground are written into these geoms.

    Args:
        model: The model, edited in place; its layout stays.
        bodies: Ids of the bodies.
        factor: Factor of the sliding friction.
    """
    priority = int(model.geom_priority.max()) + 1
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies))
    for geom in geoms:
        ground = _ground_of(model, int(geom))
        if ground is not None:
            _adopt_contact_parameters(model, int(geom), ground)
    model.geom_friction[geoms, 0] *= factor
    model.geom_priority[geoms] = priority
    paired = np.isin(model.pair_geom1, geoms) | np.isin(model.pair_geom2, geoms)
    model.pair_friction[paired, :2] *= factor


def _ground_of(model: mujoco.MjModel, geom: int) -> int | None:
    """Returns the id of the first static geom that a geom can touch; None if there is none."""
    for other in np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0).tolist():
        touches = (
            model.geom_contype[geom] & model.geom_conaffinity[other]
            or model.geom_conaffinity[geom] & model.geom_contype[other]
        )
        if touches:
            return int(other)
    return None


def _adopt_contact_parameters(model: mujoco.MjModel, geom: int, other: int) -> None:
    """Writes into a geom the parameters of its contacts with another geom.

    Source: MuJoCo's ``mj_contactParam``.
    """
    own, ground = model.geom_priority[geom], model.geom_priority[other]
    if own > ground:
        return
    if own < ground:
        model.geom_condim[geom] = model.geom_condim[other]
        model.geom_friction[geom] = model.geom_friction[other]
        model.geom_solref[geom] = model.geom_solref[other]
        model.geom_solimp[geom] = model.geom_solimp[other]
        return
    weight = _weight(float(model.geom_solmix[geom]), float(model.geom_solmix[other]))
    model.geom_condim[geom] = max(model.geom_condim[geom], model.geom_condim[other])
    model.geom_friction[geom] = np.maximum(model.geom_friction[geom], model.geom_friction[other])
    one, two = model.geom_solref[geom], model.geom_solref[other]
    standard = one[0] > 0 and two[0] > 0
    model.geom_solref[geom] = (
        weight * one + (1 - weight) * two if standard else np.minimum(one, two)
    )
    model.geom_solimp[geom] = (
        weight * model.geom_solimp[geom] + (1 - weight) * model.geom_solimp[other]
    )


def _weight(own: float, other: float) -> float:
    """Returns the weight of a geom in a mean, given the ``solmix`` of both geoms."""
    if own >= _MIN_MIX and other >= _MIN_MIX:
        return own / (own + other)
    if own < _MIN_MIX and other < _MIN_MIX:
        return 0.5
    return float(own >= _MIN_MIX)
