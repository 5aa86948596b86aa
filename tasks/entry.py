"""The registry entry of a robot: its model, its failures, its tasks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.registry import cases_of
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.scores.fitness import Score
from selfmodel.robot.legs import reaches_ground
from selfmodel.robot.robot import Robot

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
