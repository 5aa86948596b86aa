"""Makes position servos of the torque motors of an MJCF.

The low-level controllers of most legged robots are position servos with gains kp and kd, while many
MJCF files of these robots have motors whose command is a torque.
"""

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import format_numbers
from selfmodel.robot.mjcf.settings import Servo

_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


def add_servos(
    document: Document, model: mujoco.MjModel, servo: Servo, reach: float | None
) -> None:
    """Makes a position servo of each torque motor that drives a hinge.

    A torque motor has a torque proportional to its command. The servo has the same torque limits.
    Its command range is the range of the hinge.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document, with the initial pose as reference pose.
        servo: Gains of all servos.
        reach: Command range of a hinge without a range, on both sides of the initial pose, rad;
            None to require a range.

    Raises:
        InputError: The model has no torque motor, or a hinge of one has no range.
    """
    converted = 0
    for motor, element in enumerate(document.children("actuator")):
        if not _is_torque_motor(model, motor):
            continue
        joint = int(model.actuator_trnid[motor, 0])
        attributes = servo_attributes(
            servo, _travel(model, joint, reach), _torque_limits(model, motor)
        )
        kept = {"name": element.get("name", ""), "joint": model.joint(joint).name}
        element.tag, element.attrib = "general", kept | attributes
        converted += 1
    if not converted:
        raise InputError(
            "expected a motor with a torque as its command for servo, got none: the motors of this "
            "model are servos already, or drive no hinge; remove the setting servo"
        )
    document.notes.append(
        f"{converted} torque motors are position servos with kp={servo.kp:g} and kd={servo.kd:g}, "
        f"and the same torque limits"
    )


def servo_attributes(
    servo: Servo, travel: tuple[float, float], torque: tuple[float, float] | None
) -> dict[str, str]:
    """Returns the attributes of a ``<general>`` actuator of a hinge that is a position servo.

    Args:
        servo: Gains.
        travel: Lowest and highest command, rad.
        torque: Lowest and highest torque, N m; None without limits.
    """
    limits = {"forcelimited": "false"}
    if torque is not None:
        limits = {"forcelimited": "true", "forcerange": format_numbers(np.array(torque))}
    return {
        "gear": "1",
        "dyntype": "none",
        "gaintype": "fixed",
        "biastype": "affine",
        "gainprm": format_numbers(np.array((servo.kp, 0.0, 0.0))),
        "biasprm": format_numbers(np.array((0.0, -servo.kp, -servo.kd))),
        "ctrllimited": "true",
        "ctrlrange": format_numbers(np.array(travel)),
        **limits,
    }


def _is_torque_motor(model: mujoco.MjModel, motor: int) -> bool:
    return (
        int(model.actuator_trntype[motor]) == _JOINT
        and int(model.jnt_type[model.actuator_trnid[motor, 0]]) == _HINGE
        and int(model.actuator_dyntype[motor]) == int(mujoco.mjtDyn.mjDYN_NONE)
        and int(model.actuator_gaintype[motor]) == int(mujoco.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[motor]) == int(mujoco.mjtBias.mjBIAS_NONE)
    )


def _travel(model: mujoco.MjModel, joint: int, reach: float | None) -> tuple[float, float]:
    """Returns the lowest and highest command of the servo of a hinge, rad."""
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint]
        return float(low), float(high)
    if reach is None:
        name = model.joint(joint).name
        raise InputError(
            f"expected a range of the joint {name} for the commands of its servo, got none: give "
            f'the joint a range in the MJCF, such as range="-1 1", or set reach=0.5, the largest '
            f"distance of all commands from the initial pose, rad"
        )
    centre = float(model.qpos0[model.jnt_qposadr[joint]])
    return centre - reach, centre + reach


def _torque_limits(model: mujoco.MjModel, motor: int) -> tuple[float, float] | None:
    """Returns the lowest and highest torque of a torque motor at its joint, N m."""
    gain, gear = float(model.actuator_gainprm[motor, 0]), float(model.actuator_gear[motor, 0])
    limits = []
    if model.actuator_ctrllimited[motor]:
        limits.append(gain * model.actuator_ctrlrange[motor])
    if model.actuator_forcelimited[motor]:
        limits.append(np.array(model.actuator_forcerange[motor]))
    if not limits:
        return None
    torques = np.sort(gear * np.array(limits), axis=1)
    return float(torques[:, 0].max()), float(torques[:, 1].min())
