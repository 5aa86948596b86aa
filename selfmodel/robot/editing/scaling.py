"""Scales the physical parameters of a compiled model."""

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
