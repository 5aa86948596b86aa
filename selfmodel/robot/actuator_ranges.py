"""What each motor of a model may be commanded: the range that a controller's outputs span."""

import math

import mujoco

from selfmodel.controllers.command_range import Ranges
from selfmodel.errors import InputError

Range = tuple[float, float]
"""Lowest and highest."""


def command_ranges(model: mujoco.MjModel) -> Ranges:
    """Returns the centre and half range of the commands of each motor, in the model's order.

    It is ``ctrlrange`` where the motor has one. Otherwise, of a position servo, the commands that
    hold its joint or tendon at the ends of its range; of any other motor whose force is a multiple
    of the command, those at which the force reaches ``forcerange``, or the joint's torque its
    ``actuatorfrcrange``.

    Raises:
        InputError: A motor has none of these; the sentence names it.
    """
    return tuple(_centred(_range(model, motor)) for motor in range(model.nu))


def says_its_range(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether a motor says what it may be commanded, in one of these ways."""
    return _found(model, motor) is not None


def _found(model: mujoco.MjModel, motor: int) -> Range | None:
    if model.actuator_ctrllimited[motor]:
        low, high = model.actuator_ctrlrange[motor]
        return float(low), float(high)
    return _of_position(model, motor) or _of_force(model, motor)


def _range(model: mujoco.MjModel, motor: int) -> Range:
    found = _found(model, motor)
    if found is None:
        raise InputError(
            f"the motor {model.actuator(motor).name or motor} does not say what it may be "
            f'commanded: give it a ctrlrange in the MJCF, such as ctrlrange="-1 1"'
        )
    return found


def _of_position(model: mujoco.MjModel, motor: int) -> Range | None:
    """Where a position servo holds what it drives at either end of its range."""
    gain, bias = _linear(model, motor)
    travel = _travel(model, motor)
    if not gain or not bias[1] or travel is None:
        return None
    gear = float(model.actuator_gear[motor, 0])
    return _ordered(*(-(bias[0] + bias[1] * gear * end) / gain for end in travel))


def _of_force(model: mujoco.MjModel, motor: int) -> Range | None:
    """The commands at which a motor at rest gives its largest forces."""
    gain, _ = _linear(model, motor)
    if not gain:
        return None
    if model.actuator_forcelimited[motor]:
        return _ordered(*(float(force) / gain for force in model.actuator_forcerange[motor]))
    joint, gear = _joint(model, motor), float(model.actuator_gear[motor, 0])
    if joint is not None and gear and model.jnt_actfrclimited[joint]:
        return _ordered(*(float(f) / (gain * gear) for f in model.jnt_actfrcrange[joint]))
    return None


def _linear(model: mujoco.MjModel, motor: int) -> tuple[float, tuple[float, float]]:
    """Gain and bias of a force that is gain x command + bias[0] + bias[1] x length; gain 0 if not.

    Damping is left out: it is 0 at rest.
    """
    if (
        int(model.actuator_dyntype[motor]) not in _FOLLOWS
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
    """The range of the joint or tendon that a motor drives, if that is limited."""
    joint = _joint(model, motor)
    if joint is not None:
        scalar = int(model.jnt_type[joint]) in _SCALAR
        low, high = model.jnt_range[joint]
        return (float(low), float(high)) if scalar and model.jnt_limited[joint] else None
    if model.actuator_trntype[motor] == mujoco.mjtTrn.mjTRN_TENDON:
        tendon = model.actuator_trnid[motor, 0]
        low, high = model.tendon_range[tendon]
        return (float(low), float(high)) if model.tendon_limited[tendon] else None
    return None


def _joint(model: mujoco.MjModel, motor: int) -> int | None:
    moves = int(model.actuator_trntype[motor]) in _OF_JOINTS
    return int(model.actuator_trnid[motor, 0]) if moves else None


def _ordered(one: float, other: float) -> Range | None:
    ends = min(one, other), max(one, other)
    return ends if math.isfinite(ends[0]) and math.isfinite(ends[1]) and ends[0] < ends[1] else None


def _centred(ends: Range) -> tuple[float, float]:
    low, high = ends
    return (low + high) / 2 + 0.0, (high - low) / 2  # -0 is 0


# As numbers: a number of a model is in no tuple of enumerations.
_SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_OF_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_FOLLOWS = (
    int(mujoco.mjtDyn.mjDYN_NONE),
    int(mujoco.mjtDyn.mjDYN_FILTER),
    int(mujoco.mjtDyn.mjDYN_FILTEREXACT),
)
"""The activations that come to rest at the command."""
