"""Command ranges of the actuators of a model: the range of a controller's outputs."""

import math

import mujoco

from selfmodel.controllers.command_range import Ranges
from selfmodel.errors import InputError

Range = tuple[float, float]
"""Lower and upper end of a range, in the unit of the commands, the joint or the tendon."""


def command_ranges(model: mujoco.MjModel) -> Ranges:
    """Returns the centre and the half range of the commands of each motor, in the model's order.

    The command range of a motor is its ``ctrlrange``. A position servo without one has the commands
    that hold its joint or tendon at the ends of the range of the joint or tendon. Any other motor
    with a force proportional to its command has the commands at which the force reaches
    ``forcerange``, or the torque of the joint reaches the joint's ``actuatorfrcrange``.

    Raises:
        InputError: A motor has none of these ranges; the message contains the name of the motor.
    """
    return tuple(_centre_and_half(_range(model, motor)) for motor in range(model.nu))


def has_command_range(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether a motor has a command range as in ``command_ranges``."""
    return _range_or_none(model, motor) is not None


def _range_or_none(model: mujoco.MjModel, motor: int) -> Range | None:
    if model.actuator_ctrllimited[motor]:
        low, high = model.actuator_ctrlrange[motor]
        return float(low), float(high)
    return _servo_range(model, motor) or _force_range(model, motor)


def _range(model: mujoco.MjModel, motor: int) -> Range:
    ends = _range_or_none(model, motor)
    if ends is None:
        raise InputError(
            f"expected a command range for each motor, got none for the motor "
            f"{model.actuator(motor).name or motor}: give it a ctrlrange in the MJCF, such as "
            f'ctrlrange="-1 1"'
        )
    return ends


def _servo_range(model: mujoco.MjModel, motor: int) -> Range | None:
    """Returns the commands of a position servo at the ends of the range of its joint or tendon."""
    gain, bias = _linear_force(model, motor)
    travel = _travel(model, motor)
    if not gain or not bias[1] or travel is None:
        return None
    gear = float(model.actuator_gear[motor, 0])
    return _ordered(*(-(bias[0] + bias[1] * gear * end) / gain for end in travel))


def _force_range(model: mujoco.MjModel, motor: int) -> Range | None:
    """Returns the commands of the largest forces of a motor at rest."""
    gain, _ = _linear_force(model, motor)
    if not gain:
        return None
    if model.actuator_forcelimited[motor]:
        return _ordered(*(float(force) / gain for force in model.actuator_forcerange[motor]))
    joint, gear = _driven_joint(model, motor), float(model.actuator_gear[motor, 0])
    if joint is not None and gear and model.jnt_actfrclimited[joint]:
        return _ordered(*(float(f) / (gain * gear) for f in model.jnt_actfrcrange[joint]))
    return None


def _linear_force(model: mujoco.MjModel, motor: int) -> tuple[float, tuple[float, float]]:
    """Returns gain and bias of the force gain x command + bias[0] + bias[1] x length.

    The gain is 0 if the force of the motor has another form. The damping term is omitted, because
    it is 0 at rest.
    """
    if (
        int(model.actuator_dyntype[motor]) not in _SETTLES_AT_COMMAND
        or model.actuator_gaintype[motor] != mujoco.mjtGain.mjGAIN_FIXED
    ):
        return 0.0, (0.0, 0.0)
    gain = float(model.actuator_gainprm[motor, 0])
    if model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_NONE:
        return gain, (0.0, 0.0)
    if model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_AFFINE:
        constant, stiffness = model.actuator_biasprm[motor, :2]
        return gain, (float(constant), float(stiffness))
    return 0.0, (0.0, 0.0)


def _travel(model: mujoco.MjModel, motor: int) -> Range | None:
    """Returns the range of the joint or tendon that a motor drives; None if it is unlimited."""
    joint = _driven_joint(model, motor)
    if joint is not None:
        scalar = int(model.jnt_type[joint]) in _SCALAR_JOINTS
        low, high = model.jnt_range[joint]
        return (float(low), float(high)) if scalar and model.jnt_limited[joint] else None
    if model.actuator_trntype[motor] == mujoco.mjtTrn.mjTRN_TENDON:
        tendon = model.actuator_trnid[motor, 0]
        low, high = model.tendon_range[tendon]
        return (float(low), float(high)) if model.tendon_limited[tendon] else None
    return None


def _driven_joint(model: mujoco.MjModel, motor: int) -> int | None:
    has_joint = int(model.actuator_trntype[motor]) in _JOINT_TRANSMISSIONS
    return int(model.actuator_trnid[motor, 0]) if has_joint else None


def _ordered(first: float, second: float) -> Range | None:
    """Returns two ends in ascending order; None if they are equal or not finite."""
    low, high = min(first, second), max(first, second)
    return (low, high) if math.isfinite(low) and math.isfinite(high) and low < high else None


def _centre_and_half(ends: Range) -> tuple[float, float]:
    low, high = ends
    return (low + high) / 2 + 0.0, (high - low) / 2  # + 0.0 turns -0.0 into 0.0


# Integers, because an integer of a model does not compare equal to an enumeration member.
_SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_SETTLES_AT_COMMAND = (
    int(mujoco.mjtDyn.mjDYN_NONE),
    int(mujoco.mjtDyn.mjDYN_FILTER),
    int(mujoco.mjtDyn.mjDYN_FILTEREXACT),
)
"""Activation dynamics with the command as their steady state."""
