"""Residual of an unexplained diagnosis: the signals and the time in which loss is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.verdicts.change_point import Timeline

WINDOW = 8
"""Neighbouring pieces among which the worst time is found."""

MAX_SIGNALS = 3
"""Signals that are named."""


@dataclass(frozen=True)
class Residual:
    """The loss of the best hypothesis beyond that of healthy trials.

    Attributes:
        signals: Excess of the mean loss of each signal, largest first, at most three.
        trial: Name of the trial with the worst time.
        begin: Beginning of the worst time, s since the start of that trial.
        end: End of the worst time, s.
    """

    signals: Mapping[str, float]
    trial: str
    begin: float
    end: float

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values."""
        return {
            "signals": dict(self.signals),
            "trial": self.trial,
            "begin": self.begin,
            "end": self.end,
        }


def residual_of(
    signals: Mapping[str, float],
    healthy: Mapping[str, float],
    losses: FloatArray,
    timeline: Timeline,
    names: Sequence[str],
) -> Residual | None:
    """Returns the residual of a hypothesis; None if its losses are no sums over signals.

    Args:
        signals: Mean loss of the best hypothesis by signal.
        healthy: Mean loss of the empty hypothesis on healthy trials by signal.
        losses: Losses of the best hypothesis, ``(pieces,)``.
        timeline: Times of the pieces.
        names: Names of the trials.
    """
    excess = {name: loss - healthy.get(name, 0.0) for name, loss in signals.items()}
    largest = sorted((name for name in excess if excess[name] > 0), key=lambda name: -excess[name])
    if not largest or not np.isfinite(losses).all():
        return None
    width = min(WINDOW, len(losses))
    first = int(np.argmax(np.convolve(losses, np.ones(width), mode="valid")))
    trial = int(timeline.trial[first])
    inside = np.flatnonzero(timeline.trial == trial)
    last = min(first + width - 1, int(inside[-1]))
    return Residual(
        signals={name: float(excess[name]) for name in largest[:MAX_SIGNALS]},
        trial=names[trial],
        begin=float(timeline.begin[first]),
        end=float(timeline.end[last]),
    )
