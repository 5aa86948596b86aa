"""Loads a robot from an MJCF or URDF file."""

from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.adaptation import AdaptedMjcf, adapt
from selfmodel.robot.mjcf.settings import MjcfSettings, read_settings
from selfmodel.robot.robot import Robot


def load_mjcf(path: Path | str, settings: MjcfSettings | None = None) -> Robot:
    """Returns the robot that an MJCF or URDF file describes; see docs/reference/mjcf.md.

    Args:
        path: The file, which is read only. It may name the files that ``adapt`` describes.
        settings: Properties that the file does not contain; None for the settings of the TOML file
            of the same name.

    Raises:
        InputError: The file cannot be a robot; the message has the reason and the remedy.
    """
    file = Path(path)
    adapted = adapt(file, read_settings(file) if settings is None else settings)
    return robot_from(adapted, str(file))


def robot_from(adapted: AdaptedMjcf, source: str) -> Robot:
    """Returns the robot of an adapted MJCF.

    Args:
        adapted: Adapted MJCF, as returned by ``adapt`` or ``adapt_text``.
        source: The name of the MJCF in an error message.

    Raises:
        InputError: The adapted model is no valid robot.
    """
    try:
        return Robot(adapted.name, adapted.mjcf, adapted.control_timestep, adapted.assets)
    except ValueError as error:
        raise InputError(f"{source}: {' '.join(str(error).split())}") from error
