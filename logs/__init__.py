"""The trial log: one MCAP file of ROS 2 messages a physical trial, written safely, read strictly.

What is named here reads logs, and works without MuJoCo. Writing is in ``selfmodel.logs.writer``,
a run's folder in ``selfmodel.logs.journal``.
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
