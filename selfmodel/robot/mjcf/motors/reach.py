"""Limits the commands of the position servos of an MJCF to poses near the initial pose."""

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.expand import format_numbers
from selfmodel.robot.mjcf.joint_values import JointValues, check_patterns, value_of

_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_INHERITING = ("position", "intvelocity")
"""Actuators that may have the range of their joint as command range."""


def limit_reach(document: Document, model: mujoco.MjModel, reach: JointValues) -> None:
    """Limits the command range of each position servo of a hinge.

    The new range is the part of the old range within ``reach`` of the angle of the hinge in the
    initial pose, or of the end of the old range that is closest to this angle.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document, with the initial pose as reference pose.
        reach: Largest distances of commands from the initial pose by hinge, rad.

    Raises:
        InputError: A distance is for no hinge with a position servo.
    """
    hinges = [model.joint(int(joint)).name for joint in np.flatnonzero(model.jnt_type == _HINGE)]
    check_patterns({"reach": reach}, hinges)
    limited: dict[float, int] = {}
    for motor, element in enumerate(document.children("actuator")):
        if not _is_position_servo(model, motor):
            continue
        distance = value_of(reach, model.joint(int(model.actuator_trnid[motor, 0])).name)
        if distance is None:
            continue
        centre, half = command_ranges(model)[motor]
        initial = float(model.qpos0[model.jnt_qposadr[model.actuator_trnid[motor, 0]]])
        initial = min(max(initial, centre - half), centre + half)
        ends = max(initial - distance, centre - half), min(initial + distance, centre + half)
        element.set("ctrlrange", format_numbers(np.array(ends)))
        element.set("ctrllimited", "true")
        if element.tag in _INHERITING:
            element.set("inheritrange", "0")  # MuJoCo refuses both ranges, also if one is a default
        limited[distance] = limited.get(distance, 0) + 1
    if not limited:
        raise InputError(
            "expected a position servo of a hinge for reach, got none: set kp=40 and kd=1 to "
            "make position servos of torque motors, or remove the setting reach"
        )
    document.notes.extend(
        f"the commands of {count} position servos are limited to {distance:g} rad from the initial "
        f"pose"
        for distance, count in limited.items()
    )


def _is_position_servo(model: mujoco.MjModel, motor: int) -> bool:
    """Returns whether the command of a motor is the angle of its hinge, rad."""
    return (
        int(model.actuator_trntype[motor]) == _JOINT
        and int(model.jnt_type[model.actuator_trnid[motor, 0]]) == _HINGE
        and int(model.actuator_gaintype[motor]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[motor]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        and model.actuator_gear[motor, 0] == 1.0
        and model.actuator_biasprm[motor, 1] == -model.actuator_gainprm[motor, 0] != 0.0
    )
