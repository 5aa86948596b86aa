"""Motors of an MJCF: position servos, their reach, and command ranges."""

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.actuators import command_ranges, has_command_range
from selfmodel.robot.mjcf.document import Document, format_numbers
from selfmodel.robot.mjcf.settings import JointValues, MjcfSettings, check_patterns, value_of

_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


def add_servos(document: Document, settings: MjcfSettings) -> None:
    """Makes a position servo of each torque motor that drives a hinge with gains in the settings.

    A torque motor has a torque proportional to its command. The torque of the servo is
    kp (command - angle) - kd (angular velocity), within the same limits. Its command range is the
    range of the hinge, or ``reach`` on both sides of the initial pose for a hinge without a range.

    Args:
        document: The MJCF, edited in place, with the initial pose as reference pose.
        settings: Settings with kp and kd by hinge, and reach.

    Raises:
        InputError: A gain is for no hinge with a torque motor, a hinge has one gain only, or the
            commands of a hinge have no range.
    """
    model = document.model
    hinges = [model.joint(int(joint)).name for joint in np.flatnonzero(model.jnt_type == _HINGE)]
    check_patterns({"kp": settings.kp, "kd": settings.kd}, hinges)
    converted: dict[tuple[float, float], int] = {}
    for motor, element in enumerate(document.children("actuator")):
        if not _is_torque_motor(model, motor):
            continue
        joint = int(model.actuator_trnid[motor, 0])
        name = model.joint(joint).name
        gains = value_of(settings.kp, name), value_of(settings.kd, name)
        if gains == (None, None):
            continue
        kp, kd = gains
        if kp is None or kd is None:
            raise InputError(
                f"expected kp and kd for the joint {name}, got one of them: a position servo needs "
                f"both, such as kp = 40 and kd = 1"
            )
        travel = _travel(model, joint, value_of(settings.reach, name))
        element.attrib = {
            "name": element.get("name", ""),
            "joint": name,
            **_attributes(kp, kd, travel, _torque_limits(model, motor)),
        }
        element.tag = "general"
        converted[kp, kd] = converted.get((kp, kd), 0) + 1
    if not converted:
        raise InputError(
            "expected a motor with a torque as its command for kp and kd, got none: the motors of "
            "these joints are servos already, or drive no hinge; remove kp and kd"
        )
    document.notes.extend(
        f"{count} torque motors are position servos with kp={kp:g} and kd={kd:g}, and the same "
        f"torque limits"
        for (kp, kd), count in converted.items()
    )


def _attributes(
    kp: float, kd: float, travel: tuple[float, float], torque: tuple[float, float] | None
) -> dict[str, str]:
    """Returns the attributes of a ``<general>`` actuator that is a position servo.

    Args:
        kp: Proportional gain, N m/rad.
        kd: Derivative gain, N m s/rad.
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
        "gainprm": format_numbers(np.array((kp, 0.0, 0.0))),
        "biasprm": format_numbers(np.array((0.0, -kp, -kd))),
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


_INHERITING = ("position", "intvelocity")
"""Actuators that may have the range of their joint as command range."""


def limit_reach(document: Document, reach: JointValues) -> None:
    """Limits the command range of each position servo of a hinge.

    The new range is the part of the old range within ``reach`` of the angle of the hinge in the
    initial pose, or of the end of the old range that is closest to this angle.

    Args:
        document: The MJCF, edited in place, with the initial pose as reference pose.
        reach: Largest distances of commands from the initial pose by hinge, rad.

    Raises:
        InputError: A distance is for no hinge with a position servo.
    """
    model = document.model
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


def add_command_ranges(document: Document, settings: MjcfSettings) -> None:
    """Adds the ``ctrlrange`` of the settings to each motor without a command range.

    Args:
        document: The MJCF, edited in place, with the initial pose as reference pose.
        settings: Settings with the command range.

    Raises:
        InputError: A motor has no command range, and the settings contain no command range.
    """
    model = document.model
    if settings.ctrlrange is not None:
        ends = f"{settings.ctrlrange[0]!r} {settings.ctrlrange[1]!r}"
        for motor, element in enumerate(document.children("actuator")):
            if not has_command_range(model, motor):
                element.set("ctrlrange", ends)
                element.set("ctrllimited", "true")
    try:
        command_ranges(document.model)
    except InputError as error:
        raise InputError(
            f"{error}; or set ctrlrange=[-1, 1] for all motors without a command range"
        ) from error
