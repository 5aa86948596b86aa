"""Settings of a user for the properties of a robot that its MJCF or URDF does not contain."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta

from selfmodel.errors import InputError, check_name, unknown_name
from selfmodel.files import load_toml, read_file
from selfmodel.robot.mjcf.untrusted import is_around_home

MAX_VALUE = 1e6
"""Largest gain, torque or angle."""

MAX_SETTINGS_BYTES = 2**16
"""Largest settings file, in bytes."""

FORWARD_DIRECTIONS: Mapping[str, float] = {"x": 0.0, "y": 90.0, "-x": 180.0, "-y": 270.0}
"""Angle of each possible forward direction, counterclockwise from x, degrees."""

MAX_CONTROL_TIMESTEP = 10.0
"""Upper bound of the control time step, s."""

MIN_CONTROL_TIMESTEP = 0.01
"""Lower bound of the default control time step, s."""

MIN_TIMESTEP = 1e-6
"""Smallest physics time step, s."""

NO_KEYFRAME = "none"
"""Value of ``keyframe`` for the reference pose of the MJCF."""

JointValues = Mapping[str, float]
"""Values by name of a joint or pattern such as ``*_knee``; the last that fits counts."""

Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
Time = Annotated[float, Meta(gt=0, le=MAX_VALUE)]
Pattern = Annotated[str, Meta(max_length=200)]
Positive = Mapping[Pattern, Annotated[float, Meta(gt=0, le=MAX_VALUE)]]
NotNegative = Mapping[Pattern, Annotated[float, Meta(ge=0, le=MAX_VALUE)]]
Angles = Mapping[Pattern, Annotated[float, Meta(ge=-MAX_VALUE, le=MAX_VALUE)]]


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
        velocity: Largest speeds instead of the velocity limits of a URDF, rad/s; 0 for none.
        pose: Joint angles of the initial pose of a URDF, rad; of other joints, the angle in the
            range of the joint that is nearest to 0.
        armature: Inertias of rotors, seen at their hinges, kg m².
        damping: Damping of hinges, N m s/rad.
        friction: Dry friction of hinges, N m.
        timestep: Physics time step, s; None for that of the file, 0.002 s for a URDF.
        solref: Time constant of contacts, s, and their damping ratio, for all geoms.
        reach: Largest distances of the commands of position servos from the initial pose, rad; the
            commands of other joints span their ranges.
        base: ``free`` for a base with a free joint, ``fixed`` for a base that is fixed to the
            world, as on a stand; None for the base of the file.
        base_height: Height of the root body with ``base="fixed"``, m; None for the height of the
            file, or the lowest height at which the robot cannot touch the ground if that is larger.
        assets: Folder with files that the MJCF or URDF names, in addition to its own; "" for none.
    """

    forward: Literal["x", "y", "-x", "-y"] = "x"
    keyframe: str = ""
    control_timestep: Annotated[float, Meta(gt=0, le=MAX_CONTROL_TIMESTEP)] | None = None
    touch: tuple[str, ...] | None = None
    angle: tuple[str, ...] | None = None
    ctrlrange: tuple[Finite, Finite] | None = None
    kp: Positive = field(default_factory=dict)
    kd: NotNegative = field(default_factory=dict)
    effort: NotNegative = field(default_factory=dict)
    velocity: NotNegative = field(default_factory=dict)
    pose: Angles = field(default_factory=dict)
    armature: NotNegative = field(default_factory=dict)
    damping: NotNegative = field(default_factory=dict)
    friction: NotNegative = field(default_factory=dict)
    timestep: Annotated[float, Meta(ge=MIN_TIMESTEP, le=MAX_CONTROL_TIMESTEP)] | None = None
    solref: tuple[Time, Time] | None = None
    reach: Positive = field(default_factory=dict)
    base: Literal["free", "fixed"] | None = None
    base_height: Finite | None = None
    assets: str = ""


def value_of(values: JointValues, joint: str) -> float | None:
    """Returns the value of a joint, or None."""
    fitting = [value for pattern, value in values.items() if fnmatchcase(joint, pattern)]
    return fitting[-1] if fitting else None


def check_patterns(values: JointValues, joints: Sequence[str]) -> None:
    """Checks that each name or pattern fits a joint."""
    for pattern in values:
        if not any(fnmatchcase(joint, pattern) for joint in joints):
            raise unknown_name("joint", pattern, list(joints))


def read_settings(path: Path, extra: Mapping[str, Any] | None = None) -> MjcfSettings:
    """Returns the settings of an MJCF or URDF file: of the TOML file of the same name.

    Those of ``extra`` take precedence. Its folders are relative to the working folder; those in the
    file, to the folder of the file.
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
        advice = f": {file.name} has settings of {path.name}; give another file another name"
        raise InputError(f"{file}: {error}{advice}") if loaded else error from None


def _folder_of(file: Path, assets: object) -> str:
    """Returns the folder that a file of settings, which may be from any source, names."""
    if not isinstance(assets, str) or "\0" in assets or Path(assets).is_absolute():
        raise InputError(
            f"assets needs the path of a folder, relative to this file, got {assets!r}: give an "
            f"absolute path with --set assets=DIR"
        )
    folder = file.parent / assets
    if is_around_home(folder):
        raise InputError(
            f"assets may not be the home folder, or a folder around it, got {assets!r}: give that "
            f"folder with --set assets=DIR"
        )
    return str(folder)


def parse_setting(text: str) -> dict[str, Any]:
    """Returns the setting in a text such as ``forward=-x`` or ``touch=["left_foot"]``."""
    key, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise InputError(f"expected a setting such as forward=-x, got {text!r}")
    try:
        return {key.strip(): load_toml(f"value = {value}")["value"]}
    except ValueError:
        return {key.strip(): value.strip()}  # an unquoted word


_NAMES = 'a list of names, such as ["left_foot"]'
_GAIN = f"a number from above 0 to {MAX_VALUE:g} for each joint, such as "
_LIMIT = f"a number from 0 to {MAX_VALUE:g} for each joint, such as "
_NEEDED: Mapping[str, str] = {
    "forward": f"one of {', '.join(FORWARD_DIRECTIONS)}",
    "keyframe": "the name of a keyframe, or none",
    "control_timestep": f"a number from above 0 to {MAX_CONTROL_TIMESTEP:g} s",
    "touch": _NAMES,
    "angle": _NAMES,
    "ctrlrange": "two numbers, such as [-1, 1], its lower end first",
    "kp": f"{_GAIN}kp = 40 or kp = {{knee = 40}}",
    "kd": f"{_LIMIT}kd = 1 or kd = {{knee = 1}}",
    "effort": f"{_LIMIT}effort = 20 or effort = {{knee = 20}}",
    "velocity": f"{_LIMIT}velocity = 6 or velocity = {{knee = 6}}",
    "armature": f"{_LIMIT}armature = 0.005 or armature = {{knee = 0.005}}",
    "damping": f"{_LIMIT}damping = 0.1 or damping = {{knee = 0.1}}",
    "friction": f"{_LIMIT}friction = 0.05 or friction = {{knee = 0.05}}",
    "timestep": f"a number from {MIN_TIMESTEP:g} to {MAX_CONTROL_TIMESTEP:g} s",
    "solref": "a time constant, s, and a damping ratio, both above 0, such as [0.01, 1]",
    "pose": "an angle for each joint, a number, such as pose = {knee = -1.5}",
    "reach": f"{_GAIN}reach = 0.5 or reach = {{knee = 0.5}}",
    "base": "one of free, fixed",
    "base_height": 'a number of metres and base = "fixed"',
    "assets": "the path of a folder",
}
"""What a setting needs, for error messages."""

_BY_JOINT = ("kp", "kd", "effort", "velocity", "armature", "damping", "friction", "reach")
"""Settings for which one number is for all joints."""

_MAX_QUOTED = 200


def checked_settings(given: Mapping[str, Any]) -> MjcfSettings:
    """Returns validated settings of values by name; None counts as absent.

    Raises:
        InputError: A setting is unknown or invalid; the message has its name and the valid values.
    """
    types = get_type_hints(MjcfSettings, include_extras=True)
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key == "neurons":
            raise InputError(
                "neurons is a setting of a controller, not of a robot: leave neurons out, and give "
                "--neurons N to the command"
            )
        check_name("setting", key, types)
        one = key in _BY_JOINT and not isinstance(value, Mapping)
        try:
            if value is not None:
                plain = msgspec.to_builtins({"*": value} if one else value, enc_hook=_builtin)
                values[key] = msgspec.convert(plain, types[key])
        except (msgspec.ValidationError, OverflowError, NotImplementedError) as error:
            raise _invalid(key, value) from error
    low, high = values.get("ctrlrange", (0, 1))
    if not low < high:
        raise _invalid("ctrlrange", [low, high])
    if "base_height" in values and values.get("base") != "fixed":
        raise _invalid("base_height", values["base_height"])
    for key in {"touch", "angle"}.intersection(values):
        values[key] = tuple(dict.fromkeys(values[key]))
    return MjcfSettings(**values)


def _builtin(value: object) -> object:
    """Number of numpy as Python's; msgspec knows the other types."""
    if not isinstance(value, np.generic):
        raise NotImplementedError  # how msgspec is told that a type is unknown
    return value.item()


def _invalid(key: str, value: object) -> InputError:
    try:
        text = repr(value)[:_MAX_QUOTED]
    except ValueError:  # an integer of more digits than Python writes
        text = "a number of too many digits"
    return InputError(f"{key} needs {_NEEDED[key]}, got {text}")
