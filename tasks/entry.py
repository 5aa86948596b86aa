"""The registry entry of a robot, and those of the paper's two robots."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.registry import cases_of
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.scores import Score
from selfmodel.robot.contacts import reaches_ground
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory, forward_displacement

if TYPE_CHECKING:
    from dm_control.rl import control


@dataclass(frozen=True)
class Entry:
    """A robot of the registry, or a robot from a user's MJCF or URDF.

    Attributes:
        robot: Makes the healthy robot.
        suite: The robot's dm_control tasks by name; empty for robots without tasks of selfmodel.
        physical: Makes the physical robot under a hypothesis; None for a simulation of the model.
        episode_return: Score that is the sum of the task's rewards; None without a task.
    """

    robot: Callable[[], Robot]
    suite: Mapping[str, Callable[..., "control.Environment"]] = field(default_factory=dict)
    physical: Callable[[Robot, Hypothesis], PhysicalRobot] | None = None
    episode_return: Score | None = None

    @cached_property
    def cases(self) -> Mapping[int, str]:
        """Failures by their number in Table I of the paper, in notation."""
        robot = self.robot()
        return cases_of(robot.anatomy, partial(reaches_ground, robot))


CONTROL_TIMESTEP = 0.01
"""Seconds between two commands."""


def paper_robot(name: str) -> Entry:
    """Returns the registry entry of a robot, named as its MJCF file, with the task of walking."""
    return Entry(partial(_robot, name), {"walk": partial(_walk, name)}, None, WALKING_RETURN)


def _walk(name: str, **task_kwargs: Any) -> "control.Environment":  # noqa: ANN401  # of the task
    # Imported here, because dm_control's physics initialises a display when imported.
    from selfmodel.tasks import walking  # noqa: PLC0415  # see the line above

    return walking.environment(_robot(name), **task_kwargs)


def _robot(name: str) -> Robot:
    mjcf = (Path(__file__).parent / f"{name}.xml").read_text(encoding="utf-8")
    return Robot(name=name, mjcf=mjcf, control_timestep=CONTROL_TIMESTEP)


def _speeds(robot: Robot, _hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
    return forward_displacement(trajectory) / robot.control_timestep


WALKING_RETURN = Score("return", ("base_position",), _speeds)
"""Sum of the rewards of ``walking.Walk``, m/s: the displacement over the control time step."""
