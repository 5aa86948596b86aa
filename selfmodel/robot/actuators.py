"""Actuators of a compiled model: what they and its tendons move, and their command ranges."""

from collections import Counter

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Ranges
from selfmodel.errors import InputError

# Integers, because an integer of a model does not compare equal to an enumeration member.
_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_TENDON, _SITE = int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtTrn.mjTRN_SITE)
_BODY = int(mujoco.mjtTrn.mjTRN_BODY)
SUPPORTED_TRANSMISSIONS = (*_JOINT, _TENDON, _SITE, _BODY)
"""Transmission types that the motors of a robot may have, as ``mjtTrn`` numbers."""

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_SCALAR_JOINTS = (_HINGE, int(mujoco.mjtJoint.mjJNT_SLIDE))
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_WRAPPED_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)
_WRAPPED_GEOM = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))
_DYN = mujoco.mjtDyn
_SETTLES_AT_COMMAND = (int(_DYN.mjDYN_NONE), int(_DYN.mjDYN_FILTER), int(_DYN.mjDYN_FILTEREXACT))
"""Activation dynamics with the command as their steady state."""


def ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """Returns the ids of a body and of those that carry it, without the world, nearest first."""
    chain = []
    while body:
        chain.append(body)
        body = int(model.body_parentid[body])
    return chain


def motor_joints(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the joints that a motor moves, directly or through a tendon."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({target})
    return tendon_joints(model, target) if kind == _TENDON else frozenset()


def driven_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns for each motor the name of the joint that it alone drives, or else its own name."""
    own = [model.actuator(motor).name for motor in range(model.nu)]
    joints = [motor_joints(model, motor) for motor in range(model.nu)]
    driven = Counter(joint for moved in joints for joint in moved)
    names = [
        model.joint(min(moved)).name if len(moved) == 1 and driven[min(moved)] == 1 else name
        for name, moved in zip(own, joints, strict=True)
    ]
    return tuple(names if len(set(names)) == len(names) else own)


def motor_bodies(model: mujoco.MjModel, motor: int) -> frozenset[int]:
    """Returns the ids of the bodies that a motor requires to have an effect."""
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    if kind in _JOINT:
        return frozenset({int(model.jnt_bodyid[target])})
    if kind == _TENDON:
        return tendon_bodies(model, target)
    return frozenset({target if kind == _BODY else int(model.site_bodyid[target])})


def has_feedback(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether the force of a motor depends on its position, as that of a servo does."""
    is_affine = model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(is_affine and model.actuator_biasprm[motor, 1] != 0)


def holding_commands(model: mujoco.MjModel) -> FloatArray:
    """Returns the commands that hold a robot in its initial pose, ``(motors,)``.

    Servos are commanded to the initial pose, and other motors, and those with an activation, to 0.
    """
    gain, (constant, slope) = model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :2].T
    servo = (
        (model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE)
        & (model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED)
        & (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE)
        & (slope != 0)
        & (gain != 0)
    )
    force = -slope * model.actuator_length0 - constant
    return np.asarray(np.divide(force, gain, out=np.zeros(model.nu), where=servo))


def length_per_angle(model: mujoco.MjModel, motor: int, hinge: int) -> float:
    """Returns the change of a motor's length per angle of a hinge, in the motor's unit per rad.

    It is constant for motors that act on the hinge, or on a fixed tendon. It is 0 for all others:
    the length of a spatial tendon is no function of the measured angle of a single hinge.
    """
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    gear = float(model.actuator_gear[motor, 0])
    if kind in _JOINT:
        return gear if target == hinge else 0.0
    if kind != _TENDON:
        return 0.0
    path = _path(model, target)
    of_hinge = (model.wrap_type[path] == _WRAPPED_JOINT) & (model.wrap_objid[path] == hinge)
    return gear * float(model.wrap_prm[path][of_hinge].sum())


def tendon_joints(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the joints that change the length of a tendon.

    The model lists the joints of a fixed tendon. For a spatial tendon, the result has each hinge
    that moves some, but not all, of the bodies on the path of the tendon.
    """
    joints = _wrapped(model, tendon, (_WRAPPED_JOINT,))
    if len(joints):
        return frozenset(joints.tolist())
    chains = [ancestors(model, body) for body in tendon_bodies(model, tendon)]
    return frozenset(
        joint
        for joint in np.flatnonzero(model.jnt_type == _HINGE).tolist()
        if 0 < sum(model.jnt_bodyid[joint] in chain for chain in chains) < len(chains)
    )


def tendon_bodies(model: mujoco.MjModel, tendon: int) -> frozenset[int]:
    """Returns the ids of the bodies on the path of a tendon, all required for its effect."""
    owners = (
        (model.jnt_bodyid, (_WRAPPED_JOINT,)),
        (model.site_bodyid, (_WRAPPED_SITE,)),
        (model.geom_bodyid, _WRAPPED_GEOM),
    )
    bodies = [owner[_wrapped(model, tendon, kinds)] for owner, kinds in owners]
    return frozenset(np.concatenate(bodies).tolist())


def _path(model: mujoco.MjModel, tendon: int) -> slice:
    first = int(model.tendon_adr[tendon])
    return slice(first, first + int(model.tendon_num[tendon]))


def _wrapped(model: mujoco.MjModel, tendon: int, kinds: tuple[int, ...]) -> np.ndarray:
    path = _path(model, tendon)
    return np.asarray(model.wrap_objid[path][np.isin(model.wrap_type[path], kinds)])


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
    ranges = []
    for motor in range(model.nu):
        ends = command_range(model, motor)
        if ends is None:
            raise InputError(
                f"expected a command range for each motor, got none for the motor "
                f"{model.actuator(motor).name or motor}: give it a ctrlrange in the MJCF, such as "
                f'ctrlrange="-1 1"'
            )
        low, high = ends
        ranges.append(((low + high) / 2 + 0.0, (high - low) / 2))  # + 0.0 turns -0.0 into 0.0
    return tuple(ranges)


def command_range(model: mujoco.MjModel, motor: int) -> Range | None:
    """Returns the lowest and highest command of a motor, as in ``command_ranges``, or None."""
    if model.actuator_ctrllimited[motor]:
        low, high = model.actuator_ctrlrange[motor]
        return float(low), float(high)
    gain, gear = float(model.actuator_gainprm[motor, 0]), float(model.actuator_gear[motor, 0])
    biased = model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_AFFINE
    if (
        not gain
        or model.actuator_dyntype[motor] not in _SETTLES_AT_COMMAND
        or model.actuator_gaintype[motor] != mujoco.mjtGain.mjGAIN_FIXED
        or not (biased or model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_NONE)
    ):
        return None  # the force is not gain x command + constant + stiffness x length
    constant, stiffness = map(float, model.actuator_biasprm[motor, :2] if biased else (0.0, 0.0))
    kind, target = int(model.actuator_trntype[motor]), int(model.actuator_trnid[motor, 0])
    travel = None
    if kind in _JOINT and model.jnt_limited[target] and model.jnt_type[target] in _SCALAR_JOINTS:
        travel = model.jnt_range[target]
    elif kind == _TENDON and model.tendon_limited[target]:
        travel = model.tendon_range[target]
    if stiffness and travel is not None:
        held = _ordered(*(-(constant + stiffness * gear * float(end)) / gain for end in travel))
        if held is not None:
            return held
    if model.actuator_forcelimited[motor]:
        return _ordered(*(float(force) / gain for force in model.actuator_forcerange[motor]))
    if kind in _JOINT and gear and model.jnt_actfrclimited[target]:
        return _ordered(*(float(f) / (gain * gear) for f in model.jnt_actfrcrange[target]))
    return None


def _ordered(first: float, second: float) -> Range | None:
    """Returns two ends in ascending order; None if they are equal or not finite."""
    low, high = min(first, second), max(first, second)
    return (low, high) if np.isfinite([low, high]).all() and low < high else None
