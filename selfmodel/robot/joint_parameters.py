"""Parameters of a robot's joints and motors, and robots with other parameters."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.actuators import motor_joints
from selfmodel.robot.robot import Robot

QUANTITIES = ("gain", "damping", "dry friction", "armature")
"""Fitted quantities: torque of a motor at the same target, as a factor; viscous damping of a joint,
N m s/rad; dry friction, N m; reflected rotor inertia, kg m^2."""

_REFERENCES = {"damping": 1.0, "dry friction": 1.0, "armature": 0.1}
"""Unit of a joint's parameter that is 0 in the model, relative to the joint's inertia: the damping
that stops the joint within about 1 s, the friction that slows it by 1 rad/s^2, a tenth of its
inertia."""


@dataclass(frozen=True, eq=False)
class JointParameters:
    """Parameters of the joints and motors of a robot.

    Attributes:
        values: Values of each quantity of ``QUANTITIES`` in its unit: ``(motors,)`` for the gain,
            ``(hinges,)`` for the others.
    """

    values: dict[str, FloatArray]


def joint_parameters(robot: Robot) -> JointParameters:
    """Returns the parameters of a robot's own model."""
    model, dofs = robot.model, _dofs(robot)
    return JointParameters(
        {
            "gain": np.ones(model.nu),
            "damping": model.dof_damping[dofs].copy(),
            "dry friction": model.dof_frictionloss[dofs].copy(),
            "armature": model.dof_armature[dofs].copy(),
        }
    )


def changed(robot: Robot, logarithms: dict[str, FloatArray]) -> JointParameters:
    """Returns parameters that differ from those of a robot's own model.

    A value is the nominal one times the exponential of its logarithm. A value that is 0 in the
    model is increased by its reference (``_REFERENCES``) times the exponential minus one. A
    logarithm of 0 returns the nominal value, to the bit.

    Args:
        robot: The robot.
        logarithms: For each quantity the logarithms, in the shape of its values.
    """
    inertia = robot.model.dof_M0[_dofs(robot)]
    values = {}
    for quantity, own in joint_parameters(robot).values.items():
        unit = (
            np.where(own > 0, own, _REFERENCES[quantity] * inertia)
            if (quantity in _REFERENCES)
            else own
        )
        values[quantity] = np.maximum(own + unit * np.expm1(logarithms[quantity]), 0.0)
    return JointParameters(values)


def model_with_joint_parameters(robot: Robot, parameters: JointParameters) -> mujoco.MjModel:
    """Returns a copy of a robot's model with other parameters; the control delay is unchanged."""
    model, dofs, values = copy.copy(robot.model), _dofs(robot), parameters.values
    model.dof_damping[dofs] = values["damping"]
    model.dof_frictionloss[dofs] = values["dry friction"]
    model.dof_armature[dofs] = values["armature"]
    # Both contain the stiffness of a position servo: one factor scales the torque at each target.
    model.actuator_gainprm *= values["gain"][:, np.newaxis]
    model.actuator_biasprm *= values["gain"][:, np.newaxis]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def names_of(robot: Robot, quantity: str) -> tuple[str, ...]:
    """Returns the names of the motors for the gain, and of the hinges for the other quantities."""
    return robot.anatomy.motors if quantity == "gain" else robot.anatomy.hinges


def kinds_of_joints(robot: Robot) -> IndexArray:
    """Returns the number of the kind of each hinge, ``(hinges,)``.

    Hinges are of one kind if the masses of their body and of all that it carries are equal to a
    thousandth, and so is the inertia about the hinge: left and right, front and rear.
    """
    model = robot.model
    keys = [
        tuple(
            f"{number:.3g}"
            for number in (
                model.body_mass[model.jnt_bodyid[joint]],
                model.body_subtreemass[model.jnt_bodyid[joint]],
                model.dof_M0[model.jnt_dofadr[joint]],
            )
        )
        for joint in (model.joint(name).id for name in robot.anatomy.hinges)
    ]
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return np.array([numbers[key] for key in keys], dtype=np.intp)


def joint_of_motor(robot: Robot) -> IndexArray:
    """Returns the number of the first hinge that each motor drives, ``(motors,)``; 0 without."""
    model = robot.model
    hinges = [int(model.joint(name).id) for name in robot.anatomy.hinges]
    driven = [sorted(motor_joints(model, motor) & set(hinges)) for motor in range(model.nu)]
    return np.array([hinges.index(own[0]) if own else 0 for own in driven], dtype=np.intp)


def limbs_of_hinges(robot: Robot) -> IndexArray:
    """Returns the id of the first moving body between the base and each hinge, ``(hinges,)``."""
    model = robot.model
    limbs = []
    for name in robot.anatomy.hinges:
        body = int(model.joint(name).bodyid[0])
        while model.body_weldid[model.body_parentid[body]]:
            body = int(model.body_parentid[body])
        limbs.append(body)
    return np.array(limbs, dtype=np.intp)


def _dofs(robot: Robot) -> IndexArray:
    return np.array(
        [int(robot.model.joint(name).dofadr[0]) for name in robot.anatomy.hinges], dtype=np.intp
    )
