"""Passive resistance of the hinges of a compiled model: viscous damping and dry friction."""

import mujoco

from selfmodel.robot.anatomy.transmission import motor_joints


def scale_damping(model: mujoco.MjModel, name: str, factor: float) -> None:
    """Scales the viscous damping of a hinge.

    A hinge without damping has none to scale. Its damping is increased by ``factor - 1`` times the
    damping that slows the hinge, with all that it carries, with a time constant of 1 s.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        factor: Factor of the damping.
    """
    dof = int(model.joint(name).dofadr[0])
    if model.dof_damping[dof] or model.dof_dampingpoly[dof].any():
        model.dof_damping[dof] *= factor
        model.dof_dampingpoly[dof] *= factor
    else:
        model.dof_damping[dof] = max(factor - 1, 0.0) * model.dof_M0[dof]


def add_dry_friction(model: mujoco.MjModel, name: str, fraction: float) -> None:
    """Adds dry friction to a hinge.

    Args:
        model: The model, edited in place.
        name: Name of the hinge.
        fraction: The friction, as a fraction of the largest torque of the hinge's motors.
    """
    hinge = model.joint(name)
    model.dof_frictionloss[hinge.dofadr[0]] += fraction * largest_torque(model, int(hinge.id))


def largest_torque(model: mujoco.MjModel, hinge: int) -> float:
    """Returns the largest torque of the motors of a hinge, N m; 0 without motors.

    Without a limit of its force, a motor is assumed to have the gain times the largest command, or
    times 1 without a limit of the command.

    Args:
        model: A compiled model.
        hinge: Id of the hinge.
    """
    torque = sum(
        abs(float(model.actuator_gear[motor, 0])) * _largest_force(model, motor)
        for motor in range(model.nu)
        if hinge in motor_joints(model, motor)
    )
    if model.jnt_actfrclimited[hinge]:
        return min(torque, float(abs(model.jnt_actfrcrange[hinge]).max()))
    return torque


def _largest_force(model: mujoco.MjModel, motor: int) -> float:
    if model.actuator_forcelimited[motor]:
        return float(abs(model.actuator_forcerange[motor]).max())
    limited = model.actuator_ctrllimited[motor]
    command = float(abs(model.actuator_ctrlrange[motor]).max()) if limited else 1.0
    return abs(float(model.actuator_gainprm[motor, 0])) * command
