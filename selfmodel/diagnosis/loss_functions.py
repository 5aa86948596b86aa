"""How badly hypotheses predict trials, and which trials a diagnosis looks at."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis

Losses = Callable[[Sequence[Hypothesis]], FloatArray]
"""How badly hypotheses predict each piece of some trials, ``(n, pieces)``."""


class LossFunctions(NamedTuple):
    """How badly hypotheses predict the trials that a diagnosis looks at, ``(n, pieces)`` each.

    Attributes:
        after: Of the trials to explain.
        screen: Of the same, from fewer pieces and cheaper: it tells what is far from what is near.
        before: Of trials of the robot with nothing wrong; None where there are none, or they cannot
            be compared with those to explain.
    """

    after: Losses
    screen: Losses
    before: Losses | None
