"""Scales the stiffness and the damping of the contacts of a compiled model."""

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray


def scale_contacts(model: mujoco.MjModel, stiffness: float, damping: float) -> None:
    """Scales the stiffness and the damping of the contacts of a compiled model, in place.

    Both are per unit of mass. Where the model states them directly, neither is raised above the
    largest that a physics step of length h integrates: 1 / h^2 and 1 / h; where it states a time
    constant, MuJoCo limits the constant itself. Factors of 1 change nothing, to the bit.

    Source: MuJoCo's documentation, Modeling, Solver parameters, ``solref``.

    Args:
        model: The model.
        stiffness: Factor of the stiffness.
        damping: Factor of the damping.
    """
    for solref in (model.geom_solref, model.pair_solref):
        solref[:] = _scaled(solref, stiffness, damping, model.opt.timestep)


def _scaled(solref: FloatArray, stiffness: float, damping: float, timestep: float) -> FloatArray:
    """Returns reference parameters with scaled stiffness and damping, ``(n, 2)``.

    A positive row is a time constant t and a ratio r: the stiffness is 1 / (t r)^2, the damping
    2 / t. A negative row is the stiffness and the damping, with the opposite sign.
    """
    positive = solref[:, :1] > 0
    ratios = solref * (1 / damping, damping / np.sqrt(stiffness))
    stated = -solref
    limits = np.maximum(stated, (1 / timestep**2, 1 / timestep))
    return np.where(positive, ratios, -np.minimum(stated * (stiffness, damping), limits))
