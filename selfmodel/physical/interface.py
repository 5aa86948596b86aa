"""The interface of a physical robot."""

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

from selfmodel.controllers.controller import CommandSource
from selfmodel.trials.behaviour import Sample


class PhysicalRobot(Protocol):
    """Physical robot: runs a controller and yields samples.

    Diagnosis and recovery have access to a physical robot through this method only.
    """

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller from the initial pose and yields each sample during its control step.

        The robot stops when the caller stops iterating.

        Args:
            controller: Source of the commands.
            steps: Control steps to run.

        Yields:
            State, readings and commands of each control step, ``steps`` samples. Sample times are
            nominal, exact multiples of the control time step; the measured time of a step of a
            ``TimedRobot`` is in the sample's ``moment``.
        """
        ...


@runtime_checkable
class TimedRobot(PhysicalRobot, Protocol):
    """Physical robot with a clock of its own: each of its samples has a ``moment``.

    The trials of such a robot are not reproducible, so the log of a trial that was stopped early is
    finished and marked as stopped; the log of a simulated robot remains an unfinished file.
    """

    @property
    def clock(self) -> Callable[[], float]:
        """Monotonic clock: returns the time, s, from any origin."""
        ...
