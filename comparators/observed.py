"""What a trial shows of what a comparator would look at."""

from collections.abc import Iterable

import numpy as np

from selfmodel.errors import InputError
from selfmodel.trials.behaviour import Signal
from selfmodel.trials.trial import Trial


def observed_signals(
    trial: Trial, signals: Iterable[Signal], comparator: str
) -> tuple[Signal, ...]:
    """Returns those of some signals of which the trial has anything.

    Args:
        trial: The logged trial.
        signals: What the comparator would look at.
        comparator: Its name, for the error.

    Raises:
        InputError: The trial has none of them.
    """
    asked = tuple(signals)
    found = tuple(signal for signal in asked if np.isfinite(trial.behaviour[signal]).any())
    if not found:
        raise InputError(
            f"{trial.path}: {comparator} needs one at least of {', '.join(asked)}, and the log has "
            f"none of them: leave this log out, or give another comparator"
        )
    return found
