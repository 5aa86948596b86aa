"""Steering: the strides of the motors change with the heading, so that a gait can hold it.

Every motor has a gene, by which its stride grows as the robot has turned to the left, and shrinks
as it has turned to the right, or the other way round. The turn is relative to the first control
step. No touch or angle sensor tells a robot that it walks in a curve.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.rotation import directions

HEADING = ("base_orientation",)
"""Signals that steering observes."""

MAX_TURN = 1.0
"""Largest turn that steering distinguishes, rad: a stride of it is doubled at most, or gone."""


class Steering:
    """The steering of many robots.

    Attributes:
        orientation: Orientation of the base, w x y z, ``(n, 4)``; written before each step.
    """

    def __init__(self, genes: FloatArray) -> None:
        self._genes = genes
        self.orientation = np.zeros((len(genes), 4))
        self._start: FloatArray | None = None

    def gains(self) -> FloatArray:
        """Returns the factors of the strides at the next control step, ``(n, motors)``."""
        ahead = directions(self.orientation)
        heading = np.arctan2(ahead[:, 1], ahead[:, 0])
        if self._start is None:
            self._start = heading
        turn = (heading - self._start + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(1 + self._genes * np.clip(turn / MAX_TURN, -1, 1)[:, np.newaxis])
