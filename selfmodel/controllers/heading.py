"""Heading hold: the strides of the motors change as a robot turns, so that a gait goes straight.

Every motor has a gene, by which its stride grows while the robot is turned to the left of the
forward direction, and shrinks while it is turned to the right, or the other way round. Neither
touch nor angle sensors tell a robot that it walks in a curve.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.rotation import directions

MAX_TURN = 0.5
"""Largest turn that is distinguished, rad: a stride is then doubled at most, or gone."""

HOLDS = ", which holds its heading"
"""What the description of a design with a heading hold says."""


class HeadingHold:
    """The heading hold of many robots; without genes, it observes and changes nothing.

    Attributes:
        observed: Orientation of the base, w x y z, ``(n, 4)``; see ``ControllerBatch.observed``.
    """

    def __init__(self, genes: FloatArray) -> None:
        self._genes = genes
        self.observed = {name: np.zeros((len(genes), 4)) for name in observes(genes.shape[1])}

    def scale(self, outputs: FloatArray) -> None:
        """Scales the strides of the next control step, ``(n, motors)``."""
        for orientation in self.observed.values():
            ahead = directions(orientation)
            turn = np.arctan2(ahead[:, 1], ahead[:, 0])
            outputs *= 1 + self._genes * np.clip(turn / MAX_TURN, -1, 1)[:, np.newaxis]


def observes(genes: int) -> tuple[str, ...]:
    """Returns the signals that a heading hold of some genes observes."""
    return ("base_orientation",) if genes else ()
