"""What a run is worth: the fitness of the repair EA."""

from collections.abc import Callable
from dataclasses import dataclass

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, Signal, forward_displacement


@dataclass(frozen=True)
class Score:
    """A measure of runs; more is better.

    Attributes:
        name: What it is called.
        record: The signals that it is computed from.
        of: Computes it, from a robot with nothing wrong, what is wrong with it, and what a batch
            of runs looked like, ``(n, steps, width)`` each signal: ``(n,)``, each the same
            whatever the others are.
    """

    name: str
    record: tuple[Signal, ...]
    of: Callable[[Robot, Hypothesis, Behaviour], FloatArray]


def _way(_robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    return forward_displacement(behaviour)


DISPLACEMENT = Score("displacement", ("base_position",), _way)
"""The forward displacement, m. Source: the paper, section III."""
