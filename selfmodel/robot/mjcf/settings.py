"""Settings of a user for the properties of a robot that its MJCF or URDF does not contain."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.files import load_toml, read_file
from selfmodel.robot.mjcf.untrusted import is_around_home

JointValues = Mapping[str, float]
"""Values by name of a joint or pattern such as ``*_knee``; the last that fits counts."""

MAX_VALUE = 1e6
"""Largest gain, torque or angle."""

MAX_PATTERN = 200
"""Largest name or pattern of joints, characters."""

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


def value_of(values: JointValues, joint: str) -> float | None:
    """Returns the value of a joint, or None."""
    fitting = [value for pattern, value in values.items() if fnmatchcase(joint, pattern)]
    return fitting[-1] if fitting else None


def check_patterns(values: JointValues, joints: Sequence[str]) -> None:
    """Checks that each name or pattern fits a joint.

    Raises:
        InputError: A name or pattern fits none.
    """
    for pattern in values:
        if not any(fnmatchcase(joint, pattern) for joint in joints):
            raise unknown_name("joint", pattern, list(joints))


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


def _is_number(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # a Python int may be larger than any float


def _is_timestep(value: Any) -> bool:  # noqa: ANN401  # any value of a user
    return _is_number(value) and 0 < value <= MAX_CONTROL_TIMESTEP


def _is_range(value: Any) -> bool:  # noqa: ANN401  # any value of a user
    pair = isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))
    return pair and value[0] < value[1]


def _are_names(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _is_text(value: object) -> bool:
    return isinstance(value, str)


_NAMES = 'a list of names, such as ["left_foot"]'
_RULES: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "forward": (
        lambda value: _is_text(value) and value in FORWARD_DIRECTIONS,
        f"one of {', '.join(FORWARD_DIRECTIONS)}",
    ),
    "keyframe": (_is_text, "the name of a keyframe, or none"),
    "control_timestep": (_is_timestep, f"a number from above 0 to {MAX_CONTROL_TIMESTEP:g} s"),
    "touch": (_are_names, _NAMES),
    "angle": (_are_names, _NAMES),
    "ctrlrange": (_is_range, "two numbers, such as [-1, 1], its lower end first"),
    "base": (lambda value: value in BASES, f"one of {', '.join(BASES)}"),
    "base_height": (_is_number, "a number of metres"),
    "assets": (_is_text, "the path of a folder"),
}
"""Whether a value of a setting is valid, and what is."""

_BY_JOINT = {
    "kp": "kp = 40 or kp = {knee = 40}",
    "kd": "kd = 1 or kd = {knee = 1}",
    "effort": "effort = 20 or effort = {knee = 20}",
    "pose": "pose = {knee = -1.5}",
    "reach": "reach = 0.5 or reach = {knee = 0.5}",
}
"""Example of each setting with a value for each joint."""


def checked_settings(given: Mapping[str, Any]) -> MjcfSettings:
    """Returns validated settings.

    Args:
        given: Values by setting; None counts as absent.

    Raises:
        InputError: A setting is unknown or invalid; the message has its name and the valid values.
    """
    known = [key.name for key in fields(MjcfSettings)]
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key == "neurons":
            raise InputError(
                "neurons is a setting of a controller, not of a robot: leave neurons out, and give "
                "--neurons N to the command"
            )
        if key not in known:
            raise unknown_name("setting", key, known)
        if value is None:
            continue
        if key in _BY_JOINT:
            values[key] = _by_joint(key, value)
            continue
        valid, needed = _RULES[key]
        if not valid(value):
            raise InputError(f"{key} needs {needed}, got {value!r}")
        if isinstance(value, list):
            values[key] = tuple(dict.fromkeys(value))
        else:
            values[key] = value if isinstance(value, str) else float(value)
    if "ctrlrange" in values:
        values["ctrlrange"] = tuple(map(float, values["ctrlrange"]))
    if "base_height" in values and values.get("base") != "fixed":
        raise InputError(
            f'base_height needs base = "fixed", got {values["base_height"]!r} with base '
            f"{values.get('base', 'of the file')}"
        )
    return MjcfSettings(**values)


def _by_joint(name: str, given: object) -> JointValues:
    """Returns the values of a setting by joint; one number is for all joints."""
    values = given if isinstance(given, Mapping) or name == "pose" else {"*": given}
    if not isinstance(values, Mapping):
        raise InputError(f"pose needs angles by joint, such as {_BY_JOINT['pose']}, got {given!r}")
    least, above = -MAX_VALUE if name == "pose" else 0.0, name in ("kp", "reach")
    for joint, value in values.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if (
            not number
            or not least <= value <= MAX_VALUE
            or (above and value == 0)
            or len(joint) > MAX_PATTERN
        ):
            raise InputError(
                f"{name} needs a number from {'above ' * above}{least:g} to {MAX_VALUE:g} for each "
                f"joint, such as {_BY_JOINT[name]}, got {value!r} for {joint[:MAX_PATTERN]!r}"
            )
    return {joint: float(value) for joint, value in values.items()}
