"""Equality of trial logs: what is read from a damaged log is what was written."""

import numpy as np

from selfmodel.logs import TrialLog
from selfmodel.trials.signals import SIGNALS


def check_same(read: TrialLog, whole: TrialLog, *, allow_unobserved: bool) -> None:
    """Checks that a log reads as it was written.

    Args:
        read: The log as it is read.
        whole: The log as it was written.
        allow_unobserved: Whether numbers may be NaN, and the controller a playback, as in a
            salvaged log.
    """
    found = (read.mjcf, read.control_timestep, read.settings, read.trial.robot, read.root)
    expected = (whole.mjcf, whole.control_timestep, whole.settings, whole.trial.robot, whole.root)
    if found != expected or read.trial.plan.seed != whole.trial.plan.seed:
        raise AssertionError("the record of the trial has changed")
    if not allow_unobserved and read.trial.plan != whole.trial.plan:
        raise AssertionError("the plan has changed")
    steps = read.trial.behaviour.steps
    for signal in SIGNALS:
        row, true = read.trial.behaviour[signal], whole.trial.behaviour[signal][:steps]
        equal = row.view(np.int64) == true.view(np.int64)
        if allow_unobserved:
            equal |= np.isnan(row)
        if not np.all(equal):
            raise AssertionError(f"{signal} has changed")
    _check_same_timing(read, whole, allow_unobserved=allow_unobserved)


def _check_same_timing(read: TrialLog, whole: TrialLog, *, allow_unobserved: bool) -> None:
    if read.timing is None or whole.timing is None:
        if read.timing is not whole.timing:
            raise AssertionError("the clock of the robot has changed")
        return
    steps = len(read.timing.elapsed)
    lost = np.isnan(read.timing.elapsed) if allow_unobserved else np.zeros(steps, dtype=bool)
    for name in ("elapsed", "late", "missing"):
        if not np.all((getattr(read.timing, name) == getattr(whole.timing, name)[:steps]) | lost):
            raise AssertionError(f"{name} has changed")
    if not np.all((read.timing.late & read.timing.missing)[lost]):
        raise AssertionError("a lost step is not marked")
