"""Settings of a user for the properties of a robot that its URDF does not contain."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from typing import Any

from selfmodel.errors import InputError

MAX_SETTING = 1e6
"""Largest gain, torque or angle."""

MAX_PATTERN = 200
"""Largest name or pattern of joints, characters."""

ByJoint = Mapping[str, float]
"""Values by name of a joint or pattern such as ``*_knee``; the last that fits counts."""


@dataclass(frozen=True)
class UrdfSettings:
    """Settings for the motors and the initial pose of a robot from a URDF.

    Attributes:
        kp: Proportional gain of the position servos, N m/rad; see ``FULL_EFFORT_ERROR`` for the
            default.
        kd: Derivative gain of the position servos, N m s/rad; see ``DAMPING_TIMES``.
        effort: Largest torque, N m, instead of the effort limits of the URDF.
        pose: Joint angles of the initial pose, rad; of other joints, the angle in the range of the
            joint that is nearest to 0.
        swing: Largest command, as a distance from the initial pose, rad; of other joints, commands
            span the range of the joint.
    """

    kp: ByJoint = field(default_factory=dict)
    kd: ByJoint = field(default_factory=dict)
    effort: ByJoint = field(default_factory=dict)
    pose: ByJoint = field(default_factory=dict)
    swing: ByJoint = field(default_factory=dict)


URDF_SETTINGS = tuple(field.name for field in fields(UrdfSettings))
"""Names of the settings."""


_EXAMPLES = {
    "kp": "kp = 40 or kp = {knee = 40}",
    "kd": "kd = 1 or kd = {knee = 1}",
    "effort": "effort = 20 or effort = {knee = 20}",
    "pose": "pose = {knee = -1.5}",
    "swing": "swing = 0.5 or swing = {knee = 0.5}",
}


def checked_urdf_settings(given: Mapping[str, Any]) -> UrdfSettings:
    """Returns the validated settings for a URDF.

    Args:
        given: Values by setting; other settings are ignored.

    Raises:
        InputError: A setting is invalid; the message has its name and the valid values.
    """
    return UrdfSettings(
        **{name: _by_joint(name, given[name]) for name in URDF_SETTINGS if name in given}
    )


def value_of(values: ByJoint, joint: str) -> float | None:
    """Returns the value of a joint, or None."""
    found = [value for pattern, value in values.items() if fnmatchcase(joint, pattern)]
    return found[-1] if found else None


def _by_joint(name: str, given: object) -> ByJoint:
    """Returns the values of a setting by joint; one number is for all joints."""
    values = given if isinstance(given, Mapping) or name == "pose" else {"*": given}
    if not isinstance(values, Mapping):
        raise InputError(f"pose needs angles by joint, such as {_EXAMPLES['pose']}, got {given!r}")
    least = -MAX_SETTING if name == "pose" else 0.0
    for joint, value in values.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not least <= value <= MAX_SETTING or len(joint) > MAX_PATTERN:
            raise InputError(
                f"{name} needs a number from {least:g} to {MAX_SETTING:g} for each joint, such as "
                f"{_EXAMPLES[name]}, got {value!r} for {joint[:MAX_PATTERN]!r}"
            )
    return {joint: float(value) for joint, value in values.items()}
