"""The paper's comparator: did the robot get as far as the simulation says?"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class ForwardDisplacement:
    """The absolute difference of the forward displacements, m.

    Source: the paper, section III (fitness of the diagnostic EA).

    Limits: one number says little about a whole run. Without a reality gap the true hypothesis is
    at exactly 0, but compounds of failures are hard to search for, because a half-right hypothesis
    need not be closer than a wrong one; with a gap, contact is chaotic and the number is mostly
    chance.
    """

    name: str = "forward-displacement"

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns that the path of the root body is all it looks at.

        Raises:
            InputError: The trial does not say where the root body began or ended.
        """
        if not np.isfinite(trial.displacement):
            raise InputError(
                f"{trial.path}: {self.name} needs base_position at the first and the last step, "
                f"and the log does not have it: leave this log out, or give another comparator"
            )
        return ClosedLoop(record=("base_position",))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, m."""
        return np.abs(forward_displacement(simulated) - trial.displacement)


FORWARD_DISPLACEMENT = ForwardDisplacement()
