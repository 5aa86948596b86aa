"""Scales the physical parameters of a compiled model, and of its contacts."""

import copy

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray


def scale_model(
    model: mujoco.MjModel,
    *,
    mass: FloatArray,
    inertia: FloatArray,
    friction: float,
    damping: float,
    motor_gains: FloatArray,
) -> mujoco.MjModel:
    """Returns a copy of a model with scaled parameters; its layout is the same.

    Args:
        model: A compiled model; it is not changed.
        mass: Factor of each body's mass, ``(bodies,)``.
        inertia: Factor of each body's principal moments of inertia, ``(bodies,)``.
        friction: Factor of the sliding friction of every geom and contact pair.
        damping: Factor of the damping of every joint.
        motor_gains: Factor of each actuator's force before its limits, ``(motors,)``.
    """
    model = copy.copy(model)
    model.body_mass *= mass
    model.body_inertia *= inertia[:, np.newaxis]
    model.geom_friction[:, 0] *= friction
    model.pair_friction[:, :2] *= friction
    model.dof_damping *= damping
    model.dof_dampingpoly *= damping
    # Both contain the stiffness of a position servo: one factor scales the torque at each target.
    model.actuator_gainprm *= motor_gains[:, np.newaxis]
    model.actuator_biasprm *= motor_gains[:, np.newaxis]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def scale_contacts(model: mujoco.MjModel, stiffness: float, damping: float) -> None:
    """Scales the stiffness and the damping of the contacts of a compiled model, in place.

    Both are per unit of mass. Neither is raised above the largest that a physics step of length h
    integrates: the stiffness above 1 / h^2, a stated damping above 1 / h, and that of a time
    constant above 1 / h, as MuJoCo limits it. Contacts whose two parameters have different signs,
    which MuJoCo replaces, and factors of 1 change nothing, to the bit.

    Source: MuJoCo's documentation, Modeling, Solver parameters, ``solref``.

    Args:
        model: The model.
        stiffness: Factor of the stiffness.
        damping: Factor of the damping.
    """
    if (stiffness, damping) == (1.0, 1.0):
        return
    step = model.opt.timestep
    limited = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
    for solref in (model.geom_solref, model.pair_solref):
        constants, stated = (solref > 0).all(axis=1), (solref < 0).all(axis=1)
        least = 2 * step if limited else 0.0
        solref[constants] = _constants(solref[constants], stiffness, damping, step, least)
        solref[stated] = _stated(solref[stated], stiffness, damping, step)


def _constants(
    solref: FloatArray, stiffness: float, damping: float, step: float, least: float
) -> FloatArray:
    """Returns scaled time constants t and ratios r, ``(n, 2)``.

    The stiffness is 1 / (t r)^2, the damping 2 / t, with the t that MuJoCo uses: ``least`` or more.
    """
    constant = np.maximum(solref[:, 0], least)
    product = constant * solref[:, 1]
    scaled = np.maximum(constant / damping, least)
    products = np.maximum(product / np.sqrt(stiffness), np.minimum(product, step))
    return np.column_stack([scaled, products / scaled])


def _stated(solref: FloatArray, stiffness: float, damping: float, step: float) -> FloatArray:
    """Returns scaled stiffnesses and dampings, ``(n, 2)``; both have the opposite sign."""
    own = -solref
    limits = np.maximum(own, (1 / step**2, 1 / step))
    return np.asarray(-np.minimum(own * (stiffness, damping), limits))
