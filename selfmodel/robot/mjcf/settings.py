"""Settings of a user for the properties of a robot that its MJCF or URDF does not contain."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.files import load_toml, read_file
from selfmodel.robot.mjcf.files import is_around_home

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


MAX_SETTINGS_BYTES = 2**16
"""Largest settings file, in bytes."""

FORWARD_DIRECTIONS: Mapping[str, float] = {"x": 0.0, "y": 90.0, "-x": 180.0, "-y": 270.0}
"""Angle of each possible forward direction, counterclockwise from x, degrees."""

MAX_CONTROL_TIMESTEP = 10.0
"""Upper bound of the control time step, s."""

NO_KEYFRAME = "none"
"""Value of ``keyframe`` for the reference pose of the MJCF."""


BASES = ("free", "fixed")
"""Values of ``base``."""


@dataclass(frozen=True)
class MjcfSettings:
    """Settings for the conversion of an MJCF or URDF to a robot.

    Attributes:
        forward: Forward direction of the robot, in the world frame of the file.
        keyframe: Keyframe of the initial pose; "" for ``home``, ``stand`` or ``standing``, or else
            the first keyframe; ``none`` for the reference pose.
        control_timestep: Time between two commands, s; None for the smallest multiple of the
            physics time step that is at least 0.01 s.
        touch: Bodies that get a touch sensor; None for the end of each limb.
        angle: Joints that get an angle sensor; None for every hinge that a motor drives.
        ctrlrange: Lowest and highest command of motors without a command range.
        kp: Proportional gains of position servos, N m/rad. In an MJCF, the torque motors of these
            hinges become position servos.
        kd: Derivative gains of the same servos, N m s/rad.
        effort: Largest torques instead of the effort limits of a URDF, N m.
        pose: Joint angles of the initial pose of a URDF, rad; of other joints, the angle in the
            range of the joint that is nearest to 0.
        reach: Largest distances of the commands of position servos from the initial pose, rad; the
            commands of other joints span their ranges.
        base: ``free`` for a base with a free joint, ``fixed`` for a base that is fixed to the
            world, as on a stand; None for the base of the file.
        base_height: Height of the root body with ``base="fixed"``, m; None for the height of the
            file, or the lowest height at which the robot cannot touch the ground if that is larger.
        assets: Folder with files that the MJCF or URDF names, in addition to its own; "" for none.
    """

    forward: str = "x"
    keyframe: str = ""
    control_timestep: float | None = None
    touch: tuple[str, ...] | None = None
    angle: tuple[str, ...] | None = None
    ctrlrange: tuple[float, float] | None = None
    kp: JointValues = field(default_factory=dict)
    kd: JointValues = field(default_factory=dict)
    effort: JointValues = field(default_factory=dict)
    pose: JointValues = field(default_factory=dict)
    reach: JointValues = field(default_factory=dict)
    base: str | None = None
    base_height: float | None = None
    assets: str = ""


def read_settings(path: Path, extra: Mapping[str, Any] | None = None) -> MjcfSettings:
    """Returns the settings of an MJCF or URDF file: of the TOML file of the same name.

    Args:
        path: The MJCF or URDF file.
        extra: Settings that override those of the file. Folders are relative to the working folder;
            in the file, to the folder of the file.

    Raises:
        InputError: A setting is unknown or invalid, or the file cannot be read.
    """
    file = path.with_suffix(".toml")
    loaded: dict[str, Any] = {}
    if file.exists():
        data = read_file(file, "a file of settings", MAX_SETTINGS_BYTES)
        try:
            loaded = load_toml(data.decode())
        except ValueError as error:
            raise InputError(f"{file}: expected a file of settings in TOML: {error}") from error
    try:
        if "assets" in loaded:
            loaded["assets"] = _folder_of(file, loaded["assets"])
        return checked_settings({**loaded, **(extra or {})})
    except InputError as error:
        raise InputError(f"{file}: {error}") if loaded else error from None


def _folder_of(file: Path, assets: object) -> str:
    """Returns the folder that a file of settings, which may be from any source, names."""
    if not isinstance(assets, str) or "\0" in assets or Path(assets).is_absolute():
        raise InputError(
            f"assets needs the path of a folder, relative to this file, got {assets!r}: give an "
            f"absolute path with --set assets=DIR"
        )
    folder = file.parent / assets
    if is_around_home(folder.resolve()):
        raise InputError(
            f"assets may not be the home folder, or a folder around it, got {assets!r}: give that "
            f"folder with --set assets=DIR"
        )
    return str(folder)


def parse_setting(text: str) -> dict[str, Any]:
    """Returns the setting in a text such as ``forward=-x`` or ``touch=["left_foot"]``.

    Raises:
        InputError: The text has no key or no value.
    """
    key, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise InputError(f"expected a setting such as forward=-x, got {text!r}")
    try:
        return {key.strip(): load_toml(f"value = {value}")["value"]}
    except ValueError:
        return {key.strip(): value.strip()}  # an unquoted word


def checked_settings(given: Mapping[str, Any]) -> MjcfSettings:
    """Returns validated settings.

    Args:
        given: Values by setting.

    Raises:
        InputError: A setting is unknown or invalid; the message has its name and the valid values.
    """
    for key in given:
        if key == "neurons":
            raise InputError(
                "neurons is a setting of a controller, not of a robot: leave neurons out, and give "
                "--neurons N to the command"
            )
        if key not in _KEYS:
            raise unknown_name("setting", key, _KEYS)
    step = given.get("control_timestep")
    if step is not None and not (_is_number(step) and 0 < step <= MAX_CONTROL_TIMESTEP):
        raise InputError(
            f"control_timestep needs a number from above 0 to {MAX_CONTROL_TIMESTEP:g} s, "
            f"got {step!r}"
        )
    forward, keyframe = given.get("forward", "x"), given.get("keyframe", "")
    assets = given.get("assets", "")
    if not isinstance(forward, str) or forward not in FORWARD_DIRECTIONS:
        raise InputError(f"forward needs one of {', '.join(FORWARD_DIRECTIONS)}, got {forward!r}")
    if not isinstance(keyframe, str):
        raise InputError(f"keyframe needs the name of a keyframe, or none, got {keyframe!r}")
    base, height = given.get("base"), given.get("base_height")
    if base is not None and base not in BASES:
        raise InputError(f"base needs one of {', '.join(BASES)}, got {base!r}")
    if height is not None and (base != "fixed" or not _is_number(height)):
        raise InputError(
            f'base_height needs a number of metres and base = "fixed", got {height!r} with base '
            f"{base or 'of the file'}"
        )
    if not isinstance(assets, str):
        raise InputError(f"assets needs the path of a folder, got {assets!r}")
    return MjcfSettings(
        forward=forward,
        keyframe=keyframe,
        control_timestep=None if step is None else float(step),
        touch=_names(given, "touch"),
        angle=_names(given, "angle"),
        ctrlrange=_range(given),
        base=base,
        base_height=None if height is None else float(height),
        assets=assets,
        **checked_joint_values(given),
    )


_KEYS = [key.name for key in fields(MjcfSettings)]
"""Names of the settings."""


def _is_number(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # a Python int may be larger than any float


def _range(given: Mapping[str, Any]) -> tuple[float, float] | None:
    ends = given.get("ctrlrange")
    if ends is None:
        return None
    if not (isinstance(ends, list) and len(ends) == 2 and all(map(_is_number, ends))):
        raise InputError(f"ctrlrange needs two numbers, such as [-1, 1], got {ends!r}")
    if not ends[0] < ends[1]:
        raise InputError(f"ctrlrange needs its lower end first, got {ends!r}")
    return float(ends[0]), float(ends[1])


def _names(given: Mapping[str, Any], key: str) -> tuple[str, ...] | None:
    if key not in given:
        return None
    names = given[key]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f'{key} needs a list of names, such as ["left_foot"], got {names!r}')
    return tuple(dict.fromkeys(names))
