"""Heading hold: the strides of the motors change as a robot turns, so that a gait goes straight.

Every motor has a gene, by which its stride grows while the robot is turned to the left, and shrinks
while it is turned to the right, or the other way round. The turn is relative to the first control
step. Neither touch nor angle sensors tell a robot that it walks in a curve.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.rotation import directions

MAX_TURN = 1.0
"""Largest turn that is distinguished, rad: a stride is then doubled at most, or gone."""


class HeadingHold:
    """The heading hold of many robots; without genes, it observes and changes nothing.

    Attributes:
        observed: Orientation of the base, w x y z, ``(n, 4)``; see ``ControllerBatch.observed``.
    """

    def __init__(self, genes: FloatArray) -> None:
        self._genes = genes
        self.observed = {name: np.zeros((len(genes), 4)) for name in observes(genes.shape[1])}
        self._start: FloatArray | None = None

    def scale(self, outputs: FloatArray) -> None:
        """Scales the strides of the next control step, ``(n, motors)``."""
        for orientation in self.observed.values():
            ahead = directions(orientation)
            heading = np.arctan2(ahead[:, 1], ahead[:, 0])
            if self._start is None:
                self._start = heading
            turn = (heading - self._start + np.pi) % (2 * np.pi) - np.pi
            outputs *= 1 + self._genes * np.clip(turn / MAX_TURN, -1, 1)[:, np.newaxis]


def observes(genes: int) -> tuple[str, ...]:
    """Returns the signals that a heading hold of some genes observes."""
    return ("base_orientation",) if genes else ()
