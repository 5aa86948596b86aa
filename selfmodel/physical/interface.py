"""The interface of a physical robot."""

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

from selfmodel.controllers.command_source import CommandSource
from selfmodel.trials.behaviour import Sample


class PhysicalRobot(Protocol):
    """The only way in which the algorithm reaches a robot: it runs a controller and looks on."""

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller from the start position, one sample a control step as it happens.

        A caller that stops iterating stops the robot.

        Args:
            controller: What drives the robot.
            steps: Control steps to run.

        Yields:
            The state, the readings and the commands of each step, ``steps`` of them. Times are
            those that the control loop aims at, multiples of the control time step to the bit;
            when a step really was is its ``moment``, on a robot that is ``TimedRobot``.
        """
        ...


@runtime_checkable
class TimedRobot(PhysicalRobot, Protocol):
    """A physical robot with a clock of its own: each of its samples has a ``moment``.

    No trial of it can be made again as it was. So one that is stopped before its end is kept as a
    finished log that says so, where that of a simulated robot is an unfinished file.
    """

    @property
    def clock(self) -> Callable[[], float]:
        """Tells the time, s, from any beginning; it never goes back."""
        ...
