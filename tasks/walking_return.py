"""The return of our own walking task."""

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.fitness import Score
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, forward_displacement


def _speeds(robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    return forward_displacement(behaviour) / robot.control_timestep


WALKING_RETURN = Score("return", ("base_position",), _speeds)
"""The sum of the speeds in m/s that ``walking.Walk`` rewards: the way over the time step."""
