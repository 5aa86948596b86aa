"""When the steps of a trial really happened, from the messages of its log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, frozen
from selfmodel.logs.contents import Contents
from selfmodel.logs.errors import SchemaMismatchError
from selfmodel.logs.records import TIMED_FORMAT, TrialRecord
from selfmodel.logs.signals import read_rows, times_of
from selfmodel.logs.topics import TIMING


@dataclass(frozen=True, eq=False)
class Timing:
    """The moments of a trial's steps; see ``selfmodel.trials.behaviour.StepTiming``.

    Attributes:
        elapsed: ``(steps,)`` s; NaN where it is not known.
        late: ``(steps,)``; a step that was lost counts as late.
        missing: ``(steps,)``; a step that was lost counts as missing.
    """

    elapsed: FloatArray
    late: BoolArray
    missing: BoolArray


def read_timing(path: Path, contents: Contents, record: TrialRecord, steps: int) -> Timing | None:
    """Returns when the steps really happened; None for a robot without a clock of its own.

    Args:
        path: The log, for errors.
        contents: What stands in it.
        record: What was to be done.
        steps: How many steps the log says it has.

    Raises:
        LogError: The messages are missing, or what they say cannot be.
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
    # What is not 0, so NaN too, is marked: nothing is judged by what is not known.
    return Timing(frozen(elapsed), marks[:, 0] != 0, marks[:, 1] != 0)
