"""Signals of a comparator that a trial contains."""

from collections.abc import Iterable

import numpy as np

from selfmodel.diagnosis.comparator import TrialRefusedError
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial


def observed_signals(
    trial: Trial, signals: Iterable[Signal], comparator: str
) -> tuple[Signal, ...]:
    """Returns the signals with at least one finite value in the trial.

    Args:
        trial: The logged trial.
        signals: The signals that the comparator can use.
        comparator: Name of the comparator, for the error.

    Raises:
        TrialRefusedError: The trial has none of the signals.
    """
    wanted = tuple(signals)
    found = tuple(signal for signal in wanted if np.isfinite(trial.behaviour[signal]).any())
    if not found:
        raise TrialRefusedError(
            f"{trial.path}: {comparator} needs at least one of {', '.join(wanted)}, and the log "
            f"has none of them",
            "leave this log out, or give another comparator",
        )
    return found
