"""What a user says about a robot's MJCF where the file itself does not tell."""

import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.files import read_file

LARGEST = 2**16
"""Bytes that the file of settings may have."""

DIRECTIONS: Mapping[str, float] = {"x": 0.0, "y": 90.0, "-x": 180.0, "-y": 270.0}
"""Where a robot may face in its own file, and how far to the left of x that is, degrees."""

NO_KEYFRAME = "none"


@dataclass(frozen=True)
class MjcfSettings:
    """How to read a robot from its MJCF.

    Attributes:
        forward: The direction of the world, in the file, in which the robot is to walk.
        keyframe: The keyframe in which it starts; "" for the first there is, ``none`` for the
            reference pose.
        control_timestep: Seconds between two commands; None for the smallest multiple of the
            physics time step from 0.01 s on.
        touch: The bodies that get a touch sensor; None for every distal limb.
        angle: The joints that get an angle sensor; None for every hinge that a motor drives.
        ctrlrange: Lowest and highest command of motors that have no range of their own.
    """

    forward: str = "x"
    keyframe: str = ""
    control_timestep: float | None = None
    touch: tuple[str, ...] | None = None
    angle: tuple[str, ...] | None = None
    ctrlrange: tuple[float, float] | None = None


def read_settings(path: Path, extra: Mapping[str, Any] | None = None) -> MjcfSettings:
    """Returns the settings that stand beside an MJCF file, ``ROBOT.toml`` beside ``ROBOT.xml``.

    Args:
        path: The MJCF file.
        extra: What counts in the place of what stands there.

    Raises:
        InputError: A setting is unknown or has no meaning, or the file cannot be read.
    """
    beside = path.with_suffix(".toml")
    found: dict[str, Any] = {}
    if beside.exists():
        data = read_file(beside, "a file of settings", LARGEST)
        try:
            found = tomllib.loads(data.decode())
        except (ValueError, RecursionError) as error:  # also of numbers and brackets without end
            raise InputError(f"{beside}: expected a file of settings in TOML: {error}") from error
    try:
        return checked_settings({**found, **(extra or {})})
    except InputError as error:
        raise InputError(f"{beside}: {error}") if found else error from None


def parse_setting(text: str) -> dict[str, Any]:
    """Returns the setting in a text such as ``forward=-x`` or ``touch=["left_foot"]``.

    Raises:
        InputError: It is none.
    """
    key, equals, value = text.partition("=")
    if not equals or not value.strip():
        raise InputError(f"expected a setting such as forward=-x, got {text!r}")
    try:
        return {key.strip(): tomllib.loads(f"value = {value}")["value"]}
    except (ValueError, RecursionError):
        return {key.strip(): value.strip()}  # a word without quotes


def checked_settings(given: Mapping[str, Any]) -> MjcfSettings:
    """Returns settings once each is known and has a meaning.

    Raises:
        InputError: One is not; the sentence says which and what it may be.
    """
    for key in given:
        if key == "neurons":
            raise InputError(
                "neurons is not a setting of a robot, but of its controller: leave it out, and "
                "give --neurons N to the command"
            )
        if key not in {field.name for field in fields(MjcfSettings)}:
            raise unknown_name("setting", key, [field.name for field in fields(MjcfSettings)])
    step = given.get("control_timestep")
    if step is not None and not (_is_number(step) and 0 < step <= 10):
        raise InputError(f"control_timestep needs a number from above 0 to 10 s, got {step!r}")
    forward, keyframe = given.get("forward", "x"), given.get("keyframe", "")
    if not isinstance(forward, str) or forward not in DIRECTIONS:
        raise InputError(f"forward needs one of {', '.join(DIRECTIONS)}, got {forward!r}")
    if not isinstance(keyframe, str):
        raise InputError(f"keyframe needs the name of a keyframe, or none, got {keyframe!r}")
    return MjcfSettings(
        forward=forward,
        keyframe=keyframe,
        control_timestep=None if step is None else float(step),
        touch=_names(given, "touch"),
        angle=_names(given, "angle"),
        ctrlrange=_range(given),
    )


def _is_number(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # a whole number of Python may be larger


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
