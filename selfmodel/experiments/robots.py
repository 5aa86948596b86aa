"""Robots by name or MJCF file."""

import os
from collections.abc import Iterable
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.robot.mjcf.adaptation import adapt
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from selfmodel.robot.robot import Robot
from selfmodel.tasks import Entry, entry

LARGEST_MODEL = 64 * 2**20
"""Bytes that an MJCF file may have."""


def robot_entry(name: str, settings: Iterable[str] = ()) -> Entry:
    """Returns the robot of that name, or the one that somebody's MJCF describes.

    Args:
        name: One of those that come with selfmodel, or a path that ends in ``.xml``.
        settings: What the MJCF does not tell, such as ``forward=-x``; they count before those of
            the TOML beside it.

    Raises:
        InputError: There is none, and the message names the nearest; or none can be made of the
            MJCF, or settings are given for a robot that needs none.
    """
    given = tuple(settings)
    if is_model(name):
        made = load_mjcf(Path(name), _settings(name, given))
        return Entry(robot=lambda: made)
    if given:
        raise InputError(f"--set {given[0]} is for a robot's MJCF: {name!r} has all that it needs")
    # Nothing is drawn here, and dm_control would look for what to draw with.
    os.environ.setdefault("MUJOCO_GL", "disable")
    return entry(name)


def notes_on(name: str, settings: Iterable[str]) -> tuple[str, ...]:
    """Returns what was done to an MJCF to make a robot of it; see ``robot_entry``."""
    return adapt(Path(name), _settings(name, settings)).notes


def _settings(name: str, given: Iterable[str]) -> MjcfSettings:
    extra = {key: value for text in given for key, value in parse_setting(text).items()}
    return read_settings(Path(name), extra)


def is_model(name: str) -> bool:
    """Returns whether a robot's name is the path of an MJCF file."""
    return Path(name).suffix.lower() == ".xml"


def robot(name: str, control_timestep: float) -> Robot:
    """Returns the robot of that name, or the one that an MJCF file describes.

    Args:
        name: One that ``selfmodel robots`` lists, or a path that ends in ``.xml``.
        control_timestep: Seconds between two commands, for the MJCF file.

    Raises:
        InputError: There is none, or the model cannot be used.
    """
    path = Path(name)
    if not is_model(name):
        return robot_entry(name).robot()
    data = read_file(path, "an MJCF file", LARGEST_MODEL)
    try:
        return Robot(path.stem, data.decode(), control_timestep)
    except (ValueError, KeyError) as error:
        what = " ".join(str(error).split())
        raise InputError(
            f"{path}: expected an MJCF file of a robot that needs no other file: {what}"
        ) from error
