"""Robots of a study: planned by the command, and loaded by the workers, which check the model."""

from collections.abc import Mapping
from typing import Any

from selfmodel.arguments import robot_entry
from selfmodel.errors import InputError
from selfmodel.recovery.repertoire.model_digest import model_digest
from selfmodel.tasks import Entry


def planned(robot: str) -> dict[str, str]:
    """Returns the parameters of a cell that determine its robot.

    Args:
        robot: Name of a robot, or path of an MJCF or URDF file.
    """
    return {"robot": robot, "model": model_digest(robot_entry(robot).robot())}


def planned_entry(parameters: Mapping[str, Any]) -> Entry:
    """Returns the robot of a cell with its cases and tasks.

    Raises:
        InputError: The model of that name is another one here.
    """
    name = parameters["robot"]
    entry = robot_entry(name)
    if model_digest(entry.robot()) != parameters["model"]:
        raise InputError(
            f"{name} is another model than when the command began, or than on the machine of the "
            f"command: restore the file, or run the command again"
        )
    return entry
