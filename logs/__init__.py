"""Trial logs: one MCAP file of ROS 2 messages per physical trial, written safely, read strictly.

The names of this module read logs without MuJoCo. ``selfmodel.logs.physical_trial`` runs and logs a
trial, ``selfmodel.logs.writer`` writes a log, ``selfmodel.logs.journal`` a run's folder.
"""

from selfmodel.logs.controllers import load_controller, save_controller
from selfmodel.logs.errors import (
    CorruptError,
    IncompleteError,
    LogError,
    LogWriteError,
    NotMcapError,
    SchemaMismatchError,
    TruncatedError,
    UnsupportedError,
)
from selfmodel.logs.reader import TrialLog, read_gap, read_log, read_truth

__all__ = [
    "CorruptError",
    "IncompleteError",
    "LogError",
    "LogWriteError",
    "NotMcapError",
    "SchemaMismatchError",
    "TrialLog",
    "TruncatedError",
    "UnsupportedError",
    "load_controller",
    "read_gap",
    "read_log",
    "read_truth",
    "save_controller",
]
