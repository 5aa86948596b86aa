"""Difference of forward displacements: the paper's comparator."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.trial import Trial

REQUEST = ClosedLoop(record=("base_position",))


@dataclass(frozen=True)
class ForwardDisplacement:
    """The absolute difference of forward displacements, m.

    Source: the paper, section III (fitness of the diagnostic EA).

    Limits: one number contains little information about a run. Without a reality gap the true
    hypothesis is at exactly 0, but compounds of failures are hard to search for, because a
    half-right hypothesis need not be closer than a wrong one; with a gap, contact is chaotic and
    the number is mostly chance.
    """

    name: str = "forward-displacement"

    def prepare(self, trial: Trial) -> "PreparedDisplacement":
        """Returns the displacement of the trial.

        Raises:
            TrialRefusedError: The base's position is unknown at the first or the last step.
        """
        if not np.isfinite(trial.displacement):
            raise TrialRefusedError(
                f"{trial.path}: {self.name} needs base_position at the first and the last step, "
                f"and the log does not have it",
                "leave this log out, or give another comparator",
            )
        return PreparedDisplacement(trial.displacement)


@dataclass(frozen=True)
class PreparedDisplacement:
    """A trial prepared for ``ForwardDisplacement``.

    Attributes:
        displacement: Forward displacement of the trial, m.
        request: A closed-loop rollout that records ``base_position``.
    """

    displacement: float
    request: ClosedLoop = REQUEST

    def distances(self, simulated: Behaviour) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, m."""
        return np.abs(forward_displacement(simulated) - self.displacement)


FORWARD_DISPLACEMENT = ForwardDisplacement()
