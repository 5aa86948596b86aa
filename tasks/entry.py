"""What is known of a robot beside its model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.fitness import Score
from selfmodel.robot.robot import Robot

if TYPE_CHECKING:
    from dm_control.rl import control


@dataclass(frozen=True)
class Entry:
    """A robot that is known by name, or somebody's own.

    Attributes:
        robot: Makes it, with nothing wrong.
        cases: Its failures like those of Table I of the paper, by number, in notation.
        suite: Its tasks, as dm_control's suite keeps them; those of selfmodel's own.
        physical: Makes the physical robot with something wrong, where that is more than a
            simulation of the model: the suite's environment.
        episode_return: The sum of its task's rewards, where it has a task.
    """

    robot: Callable[[], Robot]
    cases: Mapping[int, str]
    suite: Mapping[str, Callable[..., "control.Environment"]] = field(default_factory=dict)
    physical: Callable[[Robot, Hypothesis], PhysicalRobot] | None = None
    episode_return: Score | None = None
