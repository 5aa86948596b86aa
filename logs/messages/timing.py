"""Measured timing of the steps of a trial, from the messages of its log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.logs.errors import SchemaMismatchError
from selfmodel.logs.mcap.contents import Contents
from selfmodel.logs.messages.signals import read_rows, times_of
from selfmodel.logs.messages.topics import TIMING
from selfmodel.logs.records import TIMED_FORMAT, TrialRecord


@dataclass(frozen=True, eq=False)
class Timing:
    """Timing of a trial's steps; see ``selfmodel.trials.behaviour.StepTiming``.

    Attributes:
        elapsed: Time since the first step, ``(steps,)`` s; NaN if unknown.
        late: Flags of late steps, ``(steps,)``; a step lost from a damaged log is late.
        missing: Flags of steps without an observation, ``(steps,)``; a step lost from a damaged log
            is missing.
    """

    elapsed: FloatArray
    late: BoolArray
    missing: BoolArray


def read_timing(path: Path, contents: Contents, record: TrialRecord, steps: int) -> Timing | None:
    """Returns the measured timing of the steps; None for a robot without its own clock.

    Args:
        path: The log, for errors.
        contents: Contents of the log.
        record: Record of the trial.
        steps: Number of steps in the log's result.

    Raises:
        LogError: The messages are missing, or their values are invalid.
    """
    if record.format != TIMED_FORMAT:
        return None
    rows = read_rows(path, contents, TIMING, times_of(record, steps))["timing"]
    elapsed, marks = rows[:, 0], rows[:, 1:]
    known = elapsed[~np.isnan(elapsed)]
    if not np.all(np.isfinite(known)) or np.any(np.diff(known) < 0):
        what = f"on {TIMING.name}: expected seconds that never go back"
        raise SchemaMismatchError(path, what, good=contents.good)
    if not np.all(np.isin(marks, (0.0, 1.0)) | np.isnan(marks)):
        what = f"on {TIMING.name}: expected 0 or 1 for late and for missing"
        raise SchemaMismatchError(path, what, good=contents.good)
    # NaN, unknown, counts as late and missing: such steps are not compared with predictions.
    return Timing(frozen(elapsed), marks[:, 0] != 0, marks[:, 1] != 0)
