"""The return of the walking task."""

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, forward_displacement


def _speeds(robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    return forward_displacement(behaviour) / robot.control_timestep


WALKING_RETURN = Score("return", ("base_position",), _speeds)
"""Sum of the rewards of ``walking.Walk``, m/s: the displacement over the control time step."""
