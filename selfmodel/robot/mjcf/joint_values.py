"""Settings with a value for each joint, by name of the joint or by pattern."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

from selfmodel.errors import InputError, unknown_name

JointValues = Mapping[str, float]
"""Values by name of a joint or pattern such as ``*_knee``; the last that fits counts."""

MAX_VALUE = 1e6
"""Largest gain, torque or angle."""

MAX_PATTERN = 200
"""Largest name or pattern of joints, characters."""

_EXAMPLES = {
    "kp": "kp = 40 or kp = {knee = 40}",
    "kd": "kd = 1 or kd = {knee = 1}",
    "effort": "effort = 20 or effort = {knee = 20}",
    "pose": "pose = {knee = -1.5}",
    "reach": "reach = 0.5 or reach = {knee = 0.5}",
}


def value_of(values: JointValues, joint: str) -> float | None:
    """Returns the value of a joint, or None."""
    found = [value for pattern, value in values.items() if fnmatchcase(joint, pattern)]
    return found[-1] if found else None


def checked_joint_values(given: Mapping[str, object]) -> dict[str, JointValues]:
    """Returns the validated settings with a value for each joint.

    Args:
        given: Values by setting; other settings are ignored.

    Raises:
        InputError: A setting is invalid; the message has its name and the valid values.
    """
    return {name: _by_joint(name, given[name]) for name in _EXAMPLES if name in given}


def check_patterns(settings: Mapping[str, JointValues], joints: Sequence[str]) -> None:
    """Checks that each name or pattern fits a joint.

    Args:
        settings: Values by joint, by name of the setting.
        joints: Names of the joints.

    Raises:
        InputError: A name or pattern fits none.
    """
    for values in settings.values():
        for pattern in values:
            if not any(fnmatchcase(joint, pattern) for joint in joints):
                raise unknown_name("joint", pattern, list(joints))


def _by_joint(name: str, given: object) -> JointValues:
    """Returns the values of a setting by joint; one number is for all joints."""
    values = given if isinstance(given, Mapping) or name == "pose" else {"*": given}
    if not isinstance(values, Mapping):
        raise InputError(f"pose needs angles by joint, such as {_EXAMPLES['pose']}, got {given!r}")
    least = -MAX_VALUE if name == "pose" else 0.0
    for joint, value in values.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        too_small = number and name in ("kp", "reach") and value == 0
        if not number or not least <= value <= MAX_VALUE or too_small or len(joint) > MAX_PATTERN:
            above = "above " if name in ("kp", "reach") else ""
            raise InputError(
                f"{name} needs a number from {above}{least:g} to {MAX_VALUE:g} for each joint, "
                f"such as {_EXAMPLES[name]}, got {value!r} for {joint[:MAX_PATTERN]!r}"
            )
    return {joint: float(value) for joint, value in values.items()}
