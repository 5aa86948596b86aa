"""What the files and folders of a robot are called."""

import re
from collections.abc import Iterable
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.experiments import robots


def key_of(robot: str) -> str:
    """Returns what stands for a robot in names of files: its name, or that of its MJCF."""
    name = Path(robot).stem if robots.is_model(robot) else robot
    return re.sub(r"[^\w.-]", "_", name, flags=re.ASCII).lstrip(".-") or "robot"


def check_keys(robots: Iterable[str]) -> None:
    """Checks that no two robots would share files.

    Raises:
        InputError: Two would; the message names both.
    """
    taken: dict[str, str] = {}
    for robot in robots:
        other = taken.setdefault(key_of(robot), robot)
        if other != robot:
            raise InputError(f"{other} and {robot} would be called alike: rename one of the files")
