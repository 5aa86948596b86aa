"""The registry entry of one of the paper's robots, with the MJCF file of the robot's name."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dm_control.utils import containers

from selfmodel.robot.robot import Robot
from selfmodel.tasks.entry import Entry
from selfmodel.tasks.walking_return import WALKING_RETURN

if TYPE_CHECKING:
    from dm_control.rl import control

CONTROL_TIMESTEP = 0.01
"""Seconds between two commands."""


def paper_robot(name: str) -> Entry:
    """Returns the registry entry of a robot with the task of walking forward.

    Args:
        name: Name of the robot and of its MJCF file, without the suffix.
    """
    suite = containers.TaggedTasks()

    @suite.add("walking")
    def walk(**task_kwargs: Any) -> "control.Environment":  # noqa: ANN401  # see walking.environment
        """Returns the task of walking forward; see ``walking.environment``."""
        # Imported here, because dm_control's physics initialises a display when imported.
        from selfmodel.tasks import walking  # noqa: PLC0415  # see the line above

        return walking.environment(_robot(name), **task_kwargs)

    return Entry(robot=partial(_robot, name), suite=suite, episode_return=WALKING_RETURN)


def _robot(name: str) -> Robot:
    mjcf = (Path(__file__).parent / f"{name}.xml").read_text(encoding="utf-8")
    return Robot(name=name, mjcf=mjcf, control_timestep=CONTROL_TIMESTEP)
