"""How badly hypotheses predict trials: what is asked of a comparator, and of which trials."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from selfmodel.arrays import FloatArray
from selfmodel.hypothesis import Hypothesis

Losses = Callable[[Sequence[Hypothesis]], FloatArray]
"""How badly hypotheses predict each piece of some trials, ``(n, pieces)``."""


class Looks(NamedTuple):
    """The trials that a diagnosis looks at.

    Attributes:
        after: Those to explain.
        screen: The same, from fewer pieces and cheaper: it tells what is far from what is near.
        before: Trials of the robot with nothing wrong; None where there are none, or they cannot be
            compared with those to explain.
    """

    after: Losses
    screen: Losses
    before: Losses | None
