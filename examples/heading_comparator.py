"""A comparator of your own: does the robot turn as the simulation says?

Usage, from this folder:
selfmodel recover quadruped --case 2 --comparator heading_comparator:HEADING

Its distance is a mean over the steps of the trial, so it says its losses too (that is optional),
and two hypotheses can be told apart by a paired test.
"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class Heading:
    """The mean absolute difference of the headings, rad, over the steps where it was observed."""

    name: str = "heading"

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns that the orientation of the root body is all it looks at."""
        if not self._seen(trial).any():
            raise InputError(
                f"{trial.path}: {self.name} needs base_orientation, and the log does not have it: "
                f"leave this log out, or give another comparator"
            )
        return ClosedLoop(record=("base_orientation",))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, rad."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each step that was observed, ``(n, steps)``, rad."""
        seen = self._seen(trial)
        x, y = forward(np.compress(seen, simulated["base_orientation"], axis=1))
        along, across = forward(trial.behaviour["base_orientation"][seen])
        # Exactly 0 between equal headings, and never more than half a turn.
        return np.abs(np.arctan2(x * across - y * along, x * along + y * across))

    def _seen(self, trial: Trial) -> BoolArray:
        return np.asarray(np.isfinite(trial.behaviour["base_orientation"]).all(axis=-1))


def forward(quaternions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns x and y, in the world, of where bodies point that w x y z quaternions turned."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)


HEADING = Heading()
