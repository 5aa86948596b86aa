"""A comparator of your own: the difference of headings.

Usage, from this folder:
selfmodel recover quadruped --case 2 --comparator heading_comparator:HEADING

It has a loss of each step of the trial, whose mean is the distance. Losses make a paired test
between two hypotheses possible; a comparator of one number per trial has ``distances`` instead.
"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.errors import InputError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

REQUEST = ClosedLoop(record=("base_orientation",))


@dataclass(frozen=True)
class Heading:
    """The mean absolute difference of the headings over the observed steps, rad."""

    name: str = "heading"

    def prepare(self, trial: Trial) -> "PreparedHeading":
        """Returns the heading of the trial.

        Raises:
            InputError: The base's orientation was not observed.
        """
        orientation = trial.trajectory["base_orientation"]
        observed = np.asarray(np.isfinite(orientation).all(axis=-1))
        if not observed.any():
            raise InputError(
                f"{trial.path}: {self.name} needs base_orientation, and the log does not have it: "
                f"leave this log out, or give another comparator"
            )
        return PreparedHeading(observed, forward(orientation[observed]))


@dataclass(frozen=True, eq=False)
class PreparedHeading:
    """A trial prepared for ``Heading``.

    Attributes:
        observed: Mask of the observed steps, ``(steps,)``.
        logged: Forward direction at the observed steps, x and y.
        request: A closed-loop rollout that records the base's orientation.
    """

    observed: BoolArray
    logged: tuple[FloatArray, FloatArray]
    request: ClosedLoop = REQUEST

    def losses(self, simulated: Trajectory) -> FloatArray:
        """Returns the loss of each observed step, ``(n, steps)``, rad."""
        x, y = forward(np.compress(self.observed, simulated["base_orientation"], axis=1))
        along, across = self.logged
        # Exactly 0 between equal headings, and never more than half a turn.
        return np.abs(np.arctan2(x * across - y * along, x * along + y * across))


def forward(quaternions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns x and y of the forward direction, in the world frame, of w x y z quaternions."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)


HEADING = Heading()
