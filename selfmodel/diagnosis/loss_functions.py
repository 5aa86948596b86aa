"""Loss functions of a diagnosis: on the damaged trials, by the surrogate, and on healthy trials.

A loss measures how badly a hypothesis predicts one segment of a trial (one window, for closed-loop
comparators). The segments of all trials are concatenated.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.faults.hypothesis import Hypothesis

Losses = Callable[[Sequence[Hypothesis]], FloatArray]
"""Returns the losses of some hypotheses, ``(n, segments)``; inf where a simulation diverged."""

SHORTLIST_SIZE = 8
"""Hypotheses that pass from the surrogate comparator to the comparator itself."""


class LossFunctions(NamedTuple):
    """The loss functions of a diagnosis, each ``(n, segments)`` with its own number of segments.

    Attributes:
        damaged: Losses on the trials to explain.
        surrogate: Losses on the same trials by the surrogate comparator, which simulates less.
        healthy: Losses on trials of the healthy robot; None if there are none, or if the losses are
            correlated over a trial and so not comparable between trials.
    """

    damaged: Losses
    surrogate: Losses
    healthy: Losses | None


def by_total_loss(hypotheses: Sequence[Hypothesis], losses: Losses) -> list[Hypothesis]:
    """Returns hypotheses sorted by the sum of their losses, smallest first; the sort is stable."""
    if not hypotheses:
        return []
    order = np.argsort(losses(hypotheses).sum(axis=1), kind="stable")
    return [hypotheses[i] for i in order]
