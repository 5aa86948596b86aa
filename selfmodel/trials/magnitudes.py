"""Plausible magnitudes of logged values: a wrong unit or a broken sensor is named beforehand."""

from collections.abc import Iterable

import numpy as np

from selfmodel.errors import InputError
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

MAX_VALUE = 1e8
"""Largest absolute value of a signal, in its SI unit. Coordinates of map projections reach 1e7 m;
at 1e8 m, a number still resolves 1e-8 m."""


def check_magnitudes(trial: Trial, signals: Iterable[Signal]) -> None:
    """Checks that the observed values of some signals can be those of a robot.

    Args:
        trial: The logged trial.
        signals: The signals to check.

    Raises:
        InputError: A value is infinite or above ``MAX_VALUE``; the message contains the first one.
    """
    for signal in signals:
        values = trial.behaviour[signal]
        wrong = np.argwhere(np.abs(values) > MAX_VALUE)
        if len(wrong):
            step, column = wrong[0].tolist()
            name = trial.behaviour.names.columns(signal)[column]
            raise InputError(
                f"{trial.path}: {signal} {name} is {values[step, column]:g} at step {step}, "
                f"expected at most {MAX_VALUE:g} in SI units, or NaN where nothing was observed: "
                f"check the units and the odometry of the log, or leave this log out"
            )
