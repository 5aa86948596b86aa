"""Fitness functions for the repair EA."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class Score:
    """A fitness function of rollouts, to be maximised.

    Attributes:
        name: Name of the score.
        record: Signals that the score is computed from.
        of: Function of a healthy robot, a hypothesis and the behaviour of a batch of rollouts,
            ``(n, steps, width)`` per signal, that returns the scores, ``(n,)``. The score of a
            rollout does not depend on the other rollouts of the batch.
        unit: Unit of the score; "" for none.
        grows_with_time: Whether rollouts of half the steps rank controllers approximately as whole
            ones do, so that a search may begin with them.
        needs_free_base: Whether the score is a displacement of the base, which a fixed base does
            not have.
    """

    name: str
    record: tuple[Signal, ...]
    of: Callable[[Robot, Hypothesis, Behaviour], FloatArray]
    unit: str = ""
    grows_with_time: bool = False
    needs_free_base: bool = False

    def of_trial(self, robot: Robot, hypothesis: Hypothesis, trial: Trial) -> float:
        """Returns the score of a physical trial; NaN where its signals were not observed.

        Args:
            robot: The healthy robot.
            hypothesis: Faults of the physical robot.
            trial: The trial.
        """
        logged = trial.behaviour
        signals = {signal: logged[signal][np.newaxis] for signal in self.record}
        batch = Behaviour(logged.names, logged.time, signals)
        return float(self.of(robot, hypothesis, batch)[0])


def _displacement(_robot: Robot, _hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    return forward_displacement(behaviour)


DISPLACEMENT = Score(
    "displacement",
    ("base_position",),
    _displacement,
    unit="m",
    grows_with_time=True,
    needs_free_base=True,
)
"""Forward displacement, m. Source: the paper, section III."""
