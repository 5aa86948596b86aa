"""Physical robots: what the algorithm may ask of one, and a simulated one that hides its fault."""

from collections.abc import Iterator
from typing import Protocol

import mujoco
import numpy as np

from selfmodel.behaviour import SIGNALS, Sample
from selfmodel.driver import Driver, drive
from selfmodel.errors import TrialError
from selfmodel.hypothesis import INTACT, Hypothesis
from selfmodel.places import places
from selfmodel.robot import Robot
from selfmodel.senses import Senses


class PhysicalRobot(Protocol):
    """The only way in which the algorithm reaches a robot: it runs a controller and looks on."""

    def run(self, controller: Driver, steps: int) -> Iterator[Sample]:
        """Runs a controller from the start position, one sample a control step as it happens.

        A caller that stops iterating stops the robot.

        Args:
            controller: What drives the robot.
            steps: Control steps to run.

        Yields:
            The state, the readings and the commands of each step, ``steps`` of them. Times are
            those that the control loop aims at, multiples of the control time step to the bit: a
            log of this format has no place for jitter.
        """
        ...


class SimulatedRobot:
    """A physical robot in simulation, with something wrong with it that it tells nobody.

    Args:
        robot: The robot as its model describes it.
        hidden: What is wrong with it.
    """

    def __init__(self, robot: Robot, hidden: Hypothesis = INTACT) -> None:
        self._robot = robot
        self._embodiment = robot.build(hidden)

    def run(self, controller: Driver, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``. The same bits as the ``Simulator``'s.

        Raises:
            TrialError: The simulation diverged.
        """
        robot, embodiment = self._robot, self._embodiment
        model, data = embodiment.model, mujoco.MjData(embodiment.model)
        mujoco.mj_forward(model, data)
        senses = Senses(model, robot.anatomy, [embodiment])
        brain = drive([controller], embodiment.neurons[np.newaxis], len(robot.anatomy.sensors))
        where = places(robot)
        for k in range(steps):
            senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], brain.readings)
            brain.step(data.ctrl[np.newaxis])
            yield Sample(
                time=k * robot.control_timestep,
                values={
                    signal: brain.readings[0].copy()
                    if signal == "sensors"
                    else getattr(data, where[signal].field)[where[signal].columns].copy()
                    for signal in SIGNALS
                },
            )
            if k + 1 < steps:
                mujoco.mj_step(model, data, robot.substeps)
                if data.warning.number.any():
                    raise TrialError(
                        f"the simulation of the physical robot broke down after step {k}: its "
                        f"model is unstable under this controller; try a smaller physics time step"
                    )
