"""Robots by name, or by MJCF or URDF file."""

import os
from collections.abc import Iterable
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import encodable, read_file
from selfmodel.robot.mjcf.adaptation import adapt
from selfmodel.robot.mjcf.isolated_model import check_compiles
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from selfmodel.robot.mjcf.untrusted import MAX_TEXT
from selfmodel.robot.robot import Robot
from selfmodel.tasks import Entry, entry

_MODEL_ENDINGS = (".xml", ".urdf", ".xacro")
"""Endings of models; a xacro is refused with the remedy."""


def robot_entry(name: str, settings: Iterable[str] = ()) -> Entry:
    """Returns a robot, its cases and its tasks, by name or by MJCF or URDF file.

    Args:
        name: Name of a robot of selfmodel, or the path of an MJCF or URDF file.
        settings: Settings of the file, such as ``forward=-x``; they override those of the
            TOML file beside it.

    Raises:
        InputError: The name is unknown (the message has the nearest names), the file is no valid
            robot, or settings are given for a robot by name.
    """
    given = tuple(settings)
    if is_model(name):
        made = load_mjcf(Path(name), _settings(name, given))
        return Entry(robot=lambda: made)
    if given:
        raise InputError(
            f"--set {given[0]} is for an MJCF or URDF file: {name!r} is the name of a robot"
        )
    # dm_control would load an OpenGL library.
    os.environ.setdefault("MUJOCO_GL", "disable")
    return entry(name)


def notes_on(name: str, settings: Iterable[str]) -> tuple[str, ...]:
    """Returns the changes that made an MJCF or URDF file a robot; see ``robot_entry``."""
    return adapt(Path(name), _settings(name, settings)).notes


def _settings(name: str, given: Iterable[str]) -> MjcfSettings:
    extra = {key: value for text in given for key, value in parse_setting(text).items()}
    return read_settings(Path(name), extra)


def is_model(name: str) -> bool:
    """Returns whether a robot's name is the path of an MJCF or URDF file."""
    return Path(name).suffix.lower() in _MODEL_ENDINGS


def recorded_robot(name: str, control_timestep: float | None) -> Robot:
    """Returns the robot of a recording: by name, or of a model file, adapted as for a trial.

    A model that a calibration wrote is a robot already, and is not adapted.

    Args:
        name: Name of a robot of selfmodel, or the path of a model file.
        control_timestep: Duration of a control step of a model file, s; None for that of its
            settings.

    Raises:
        InputError: The name is unknown, or the model is unusable.
    """
    if not is_model(name):
        return robot_entry(name).robot()
    path = Path(name)
    if control_timestep is not None and path.suffix.lower() == ".xml":
        try:
            raw = robot(name, control_timestep)
        except InputError:
            raw = None
        if raw is not None and raw.is_calibrated:
            return raw
    step = {} if control_timestep is None else {"control_timestep": control_timestep}
    return load_mjcf(path, read_settings(path, step))


def robot(name: str, control_timestep: float) -> Robot:
    """Returns a robot by name, or the robot of an unadapted MJCF file.

    Args:
        name: Name of a robot of selfmodel, or a path that ends in ``.xml``.
        control_timestep: Duration of a control step of an MJCF file, s.

    Raises:
        InputError: The name is unknown, or the model is unusable.
    """
    path = Path(name)
    if not is_model(name):
        return robot_entry(name).robot()
    if path.suffix.lower() != ".xml":
        raise InputError(f"{path}: expected an MJCF file, ROBOT.xml, that needs no adaptation")
    data = read_file(path, "an MJCF file", MAX_TEXT)
    try:
        check_compiles(data.decode(), {}, control_timestep)
        return Robot(encodable(path.stem), data.decode(), control_timestep)
    except (ValueError, KeyError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"{path}: expected an MJCF file of a robot without other files: {reason}"
        ) from error
