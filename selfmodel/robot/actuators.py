"""Actuators of a compiled model: what they and its tendons move, and their command ranges."""

import math

import mujoco
import numpy as np

from selfmodel.controllers.controller import Ranges
from selfmodel.errors import InputError

_TRN = mujoco.mjtTrn
_JOINT = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))
_TENDON, _SITE, _BODY = int(_TRN.mjTRN_TENDON), int(_TRN.mjTRN_SITE), int(_TRN.mjTRN_BODY)
SUPPORTED_TRANSMISSIONS = (*_JOINT, _TENDON, _SITE, _BODY)
"""Transmission types that the motors of a robot may have, as ``mjtTrn`` numbers."""

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_WRAPPED_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)
_WRAPPED_GEOM = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))


def motor_joints(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the joints that a motor moves, directly or through a tendon."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({target})
    return tendon_joints(model, target) if kind == _TENDON else frozenset()


def length_per_angle(model: mujoco.MjModel, motor: int, hinge: int) -> float:
    """Returns the change of a motor's length per angle of a hinge, in the motor's unit per rad.

    It is constant for motors that act on the hinge, or on a fixed tendon. It is 0 for all others:
    the length of a spatial tendon is no function of the measured angle of a single hinge.

    Args:
        model: A compiled model.
        motor: Id of the motor.
        hinge: Id of the hinge.
    """
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    gear = float(model.actuator_gear[motor, 0])
    if kind in _JOINT:
        return gear if target == hinge else 0.0
    if kind != _TENDON:
        return 0.0
    path = slice(first := int(model.tendon_adr[target]), first + int(model.tendon_num[target]))
    own = (model.wrap_type[path] == _WRAPPED_JOINT) & (model.wrap_objid[path] == hinge)
    return gear * float(model.wrap_prm[path][own].sum())


def has_feedback(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether the force of a motor depends on its position, as that of a servo does."""
    is_affine = model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(is_affine and model.actuator_biasprm[motor, 1] != 0)


def motor_bodies(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the bodies that a motor requires to have an effect."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({int(model.jnt_bodyid[target])})
    if kind == _TENDON:
        return tendon_bodies(model, target)
    return frozenset({target if kind == _BODY else int(model.site_bodyid[target])})


def tendon_joints(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the joints that change the length of a tendon.

    The model lists the joints of a fixed tendon. For a spatial tendon, the result has each hinge
    that moves some, but not all, of the bodies on the path of the tendon.
    """
    joints = _wrapped(model, tendon, (_WRAPPED_JOINT,))
    if joints:
        return frozenset(joints)
    bodies = tendon_bodies(model, tendon)
    return frozenset(
        j
        for j in range(model.njnt)
        if model.jnt_type[j] == _HINGE
        and 0 < sum(descends(model, b, int(model.jnt_bodyid[j])) for b in bodies) < len(bodies)
    )


def tendon_bodies(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the bodies on the path of a tendon, all required for its effect."""
    joints = _wrapped(model, tendon, (_WRAPPED_JOINT,))
    sites = _wrapped(model, tendon, (_WRAPPED_SITE,))
    geoms = _wrapped(model, tendon, _WRAPPED_GEOM)
    return frozenset(
        int(body)
        for body in np.concatenate(
            [model.jnt_bodyid[joints], model.site_bodyid[sites], model.geom_bodyid[geoms]]
        )
    )


def descends(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    """Returns whether a body is the ancestor itself or a descendant of the ancestor."""
    while body > ancestor:  # the id of a child is larger than that of its parent
        body = int(model.body_parentid[body])
    return body == ancestor


def _wrapped(model: mujoco.MjModel, tendon: int, kinds: tuple[int, ...]) -> list[int]:
    """Returns the ids of the objects of some ``mjtWrap`` types on the path of a tendon."""
    first = int(model.tendon_adr[tendon])
    return [
        int(model.wrap_objid[w])
        for w in range(first, first + int(model.tendon_num[tendon]))
        if int(model.wrap_type[w]) in kinds
    ]


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
