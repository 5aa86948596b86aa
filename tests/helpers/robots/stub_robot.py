"""A physical robot that glides as far as a function of its controller requires."""

from collections.abc import Callable, Iterator

import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.errors import TrialError
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample


class StubRobot:
    """Physical robot that stays upright and moves forward evenly.

    Args:
        robot: The robot whose signals are yielded.
        displacement: Displacement of a run of a controller, m.
        ends_after: Number of samples after which the robot fails; None for never.
        falls_after: Number of samples after which the base is on the ground; None for never.
    """

    def __init__(
        self,
        robot: Robot,
        displacement: Callable[[Controller], float],
        *,
        ends_after: int | None = None,
        falls_after: int | None = None,
    ) -> None:
        self._robot, self._displacement = robot, displacement
        self._ends_after, self._falls_after = ends_after, falls_after

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Yields the samples of a run."""
        robot = self._robot
        speed = self._displacement(controller) / (steps - 1)
        for k in range(steps):
            if k == self._ends_after:
                raise TrialError("the robot failed")
            values = {signal: np.zeros(robot.anatomy.names.width(signal)) for signal in SIGNALS}
            stands = self._falls_after is None or k < self._falls_after
            values["base_position"] = np.array([k * speed, 0, robot.standing_height * stands])
            values["base_orientation"] = np.array([1.0, 0, 0, 0])
            yield Sample(k * robot.control_timestep, values)
