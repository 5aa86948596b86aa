"""The score ``energy``: upright displacement less the mechanical work of the joints."""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour

WORK_WEIGHT = 0.1
"""Metres that a work of the robot's weight times a metre costs: a gait with a cost of transport of
3, that of a fast legged robot, keeps 70 % of its displacement."""


def joint_work(robot: Robot, behaviour: Behaviour) -> FloatArray:
    """Returns the mechanical work of the joints, J, ``(...)``: work on a motor counts as spent.

    Args:
        robot: The robot, for its control time step.
        behaviour: Efforts and velocities of the joints, ``(..., steps, hinges)`` each; single NaN
            count as 0, and the work of a run without any number is NaN.
    """
    power = np.abs(behaviour["joint_efforts"] * behaviour["joint_velocities"])
    observed = np.isfinite(power).any(axis=(-2, -1))
    work = np.nansum(power, axis=(-2, -1)) * robot.control_timestep
    return np.asarray(np.where(observed, work, np.nan))


def _score(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    model = build(robot, hypothesis).model
    weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
    cost = joint_work(robot, behaviour) / weight if weight else 0.0
    return np.asarray(UPRIGHT.of(robot, hypothesis, behaviour) - WORK_WEIGHT * cost)


ENERGY = Score(
    "energy",
    ("base_position", "base_orientation", "joint_efforts", "joint_velocities"),
    _score,
    unit="m",
    needs_free_base=True,
)
"""Displacement up to the first fall, m, less ``WORK_WEIGHT`` times the work over the weight, m.

The work over the weight and the distance is the cost of transport (Gabrielli and von Karman, *What
price speed?*, 1950).
"""
