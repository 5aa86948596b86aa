"""The score ``upright``: forward displacement up to the first fall."""

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.falls import first_falls, held_at_the_end
from selfmodel.recovery.scores.fitness import Score
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


def falls_of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> IndexArray:
    """Returns the first step at which each run has fallen, or the number of steps without a fall.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the robot, of which a slope tilts the ground.
        behaviour: Position and orientation of the base, ``(..., steps, width)`` each.

    Returns:
        Step indices, ``(...)``.
    """
    return first_falls(behaviour, build(robot, hypothesis).normal, robot.standing_height)


def fall_of(robot: Robot, hypothesis: Hypothesis, trial: Trial) -> int | None:
    """Returns the step at which the robot fell in a trial; None if it did not, or cannot fall.

    A fixed base cannot fall, and a base that was not observed is not known to have fallen. A trial
    that ended early may have ended by a fall: its last pose counts as if it remained.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the physical robot.
        trial: The trial.
    """
    if robot.has_fixed_base:
        return None
    logged = trial.behaviour
    judged = held_at_the_end(logged) if logged.steps < trial.plan.steps else logged
    fall = int(falls_of(robot, hypothesis, judged))
    return fall if fall < logged.steps else None


def _displacement_until_a_fall(
    robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour
) -> FloatArray:
    x = behaviour["base_position"][..., 0]
    last = np.maximum(falls_of(robot, hypothesis, behaviour) - 1, 0)
    end = np.take_along_axis(x, last[..., np.newaxis], axis=-1)[..., 0]
    return np.asarray(end - x[..., 0])


UPRIGHT = Score(
    "upright",
    ("base_position", "base_orientation"),
    _displacement_until_a_fall,
    unit="m",
    grows_with_time=True,
    needs_free_base=True,
)
"""Forward displacement up to the last step before the robot falls, m.

A robot has fallen at the first step from which its base is, for most of ``FALLEN_TIME`` (near the
end, of the last ``FALLEN_TIME`` of the run), tilted by more than ``FALLEN_TILT`` from its initial
orientation, or lower than ``FALLEN_HEIGHT`` of its standing height. What follows a fall counts
nothing: a controller that tips the robot over and crawls on its back earns what it walked before.
"""
