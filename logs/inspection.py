"""Summary and verification of a log, without simulation."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.files import file_digest
from selfmodel.logs.errors import GOOD, CorruptError, SchemaMismatchError
from selfmodel.logs.log_file import Messages, read_contents
from selfmodel.logs.reader import TrialLog, interpret, read_log
from selfmodel.logs.records import HIDDEN, IMPORT, SALVAGE
from selfmodel.robot.mjcf.untrusted import checked_model
from selfmodel.trials.signals import SIGNALS, Signal


@dataclass(frozen=True)
class TopicInfo:
    """Type of the messages on a topic, their number, and mean rate, 1/s (0 for a single one)."""

    type: str
    messages: int
    rate: float


@dataclass(frozen=True, eq=False)
class Info:
    """Summary of a log.

    Attributes:
        log: Trial, model and settings.
        bytes: Size of the file, bytes.
        topics: Topics by name.
        attachments: Sizes of the attachments by name, bytes.
        records: Names of the metadata records.
        observed: Fraction of observed numbers by signal, in [0, 1].
        source: Origin of an imported or salvaged trial; empty for other trials.
        digest: SHA-256 of the file.
    """

    log: TrialLog
    bytes: int
    topics: Mapping[str, TopicInfo]
    attachments: Mapping[str, int]
    records: tuple[str, ...]
    observed: Mapping[Signal, float]
    source: Mapping[str, str]
    digest: str

    @property
    def driver(self) -> str:
        """Description of the controller, or of its replacement by recorded commands."""
        return self.log.trial.plan.controller.summary

    @property
    def has_truth(self) -> bool:
        """Whether the log contains the hidden faults of a simulated robot, for scoring."""
        return HIDDEN in self.records


def read_info(path: Path) -> Info:
    """Returns the summary of a log, without the hidden faults of a simulated robot.

    Raises:
        LogError: The file is damaged, or not a trial log.
        InputError: The file does not exist.
    """
    contents = read_contents(path)
    log = interpret(contents)
    signals = {signal: log.trial.trajectory[signal] for signal in SIGNALS}
    return Info(
        log=log,
        bytes=path.stat().st_size,
        topics={name: _topic(messages) for name, messages in contents.topics.items()},
        attachments={name: len(data) for name, data in contents.attachments.items()},
        records=tuple(contents.metadata),
        observed={
            signal: float(np.mean(~np.isnan(values))) if values.size else 1.0
            for signal, values in signals.items()
        },
        source=contents.metadata.get(SALVAGE) or contents.metadata.get(IMPORT) or {},
        digest=file_digest(path),
    )


def _topic(messages: Messages) -> TopicInfo:
    times = [time for time, _ in messages.times]
    span = (times[-1] - times[0]) * 1e-9 if len(times) > 1 else 0.0
    return TopicInfo(messages.type, len(times), (len(times) - 1) / span if span else 0.0)


@dataclass(frozen=True, eq=False)
class Verified:
    """Content of a verified log, whether MuJoCo has loaded its model, and the file's SHA-256."""

    log: TrialLog
    model_loaded: bool
    digest: str


def verify(path: Path, expected: str = "") -> Verified:
    """Verifies a log.

    Verified are the checks of ``read_log``; that the model names no other files; and, if MuJoCo is
    installed, that the model loads and is of the robot of the messages.

    Args:
        path: The log.
        expected: SHA-256 that the file must have, or "".

    Raises:
        LogError: A check failed.
        InputError: The file does not exist.
    """
    log, digest = read_log(path), file_digest(path)
    if expected not in ("", digest):
        what = f"expected the file with the SHA-256 {expected}, this one has {digest}"
        raise CorruptError(path, what, advice="get the expected log from its origin again")
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good=GOOD) from error
    try:
        from selfmodel.logs.robots import robot_of  # noqa: PLC0415  # it needs MuJoCo
    except ImportError:
        return Verified(log, model_loaded=False, digest=digest)
    robot_of(log)
    return Verified(log, model_loaded=True, digest=digest)
