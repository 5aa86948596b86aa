"""Columns of a trial that other trials observed too."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

SIGNALS: tuple[Signal, ...] = ("joint_positions", "joint_velocities", "sensors")
"""Signals whose columns may be lost with an encoder."""


def observed_as(trial: Trial, others: Sequence[Trial]) -> Trial:
    """Returns a trial without the columns that were never observed in one of the others.

    An unknown joint makes the prediction of the others worse. So the loss of a healthy trial is a
    reference for a trial with a lost encoder only without the same encoder.

    Args:
        trial: The trial.
        others: Trials of the same robot.

    Returns:
        The trial itself if the others lack nothing; otherwise a trial with NaN in these columns.
    """
    signals, is_lacking = dict(trial.behaviour.signals), False
    for signal in SIGNALS:
        missing = np.zeros(signals[signal].shape[1], dtype=bool)
        for other in others:
            missing |= ~np.isfinite(other.behaviour[signal]).any(axis=0)
        lost = missing & np.isfinite(signals[signal]).any(axis=0)
        if lost.any():
            is_lacking = True
            signals[signal] = np.where(lost, np.nan, signals[signal])
    if not is_lacking:
        return trial
    return dataclasses.replace(
        trial, behaviour=dataclasses.replace(trial.behaviour, signals=signals)
    )
