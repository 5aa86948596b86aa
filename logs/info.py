"""Summary of a log."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.logs.mcap.contents import Contents, read_contents
from selfmodel.logs.reader import TrialLog, interpret
from selfmodel.logs.records import HIDDEN, IMPORT, SALVAGE
from selfmodel.trials.signals import SIGNALS, Signal


@dataclass(frozen=True)
class TopicInfo:
    """Summary of one topic of a log.

    Attributes:
        type: Type of the messages.
        messages: Number of messages.
        rate: Mean message rate, 1/s; 0 for a single message.
    """

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
        driver: Description of the controller, or of its replacement by recorded commands.
        source: Origin of an imported or salvaged trial; empty for other trials.
        digest: SHA-256 over records, files and messages; "" in a log of an earlier version.
    """

    log: TrialLog
    bytes: int
    topics: Mapping[str, TopicInfo]
    attachments: Mapping[str, int]
    records: tuple[str, ...]
    observed: Mapping[Signal, float]
    driver: str
    source: Mapping[str, str]
    digest: str


def read_info(path: Path) -> Info:
    """Returns the summary of a log, without the hidden faults of a simulated robot.

    Args:
        path: The log.

    Raises:
        LogError: The file is damaged, or not a trial log.
        InputError: The file does not exist.
    """
    contents = read_contents(path)
    log = interpret(path, contents)
    behaviour, driver = log.trial.behaviour, log.trial.plan.controller
    return Info(
        log=log,
        bytes=path.stat().st_size,
        topics={name: _topic(contents, name) for name in contents.topics},
        attachments={name: len(data) for name, data in contents.attachments.items()},
        records=tuple(contents.metadata),
        observed={
            signal: float(np.mean(~np.isnan(behaviour[signal]))) if behaviour[signal].size else 1.0
            for signal in SIGNALS
        },
        driver=driver.summary,
        source=contents.metadata.get(SALVAGE) or contents.metadata.get(IMPORT) or {},
        digest=contents.digest,
    )


def has_truth(info: Info) -> bool:
    """Returns whether the log contains the hidden faults of a simulated robot, for scoring."""
    return HIDDEN in info.records


def _topic(contents: Contents, name: str) -> TopicInfo:
    messages = contents.topics[name]
    times = [time for time, _ in messages.times]
    span = (times[-1] - times[0]) * 1e-9 if len(times) > 1 else 0.0
    rate = (len(times) - 1) / span if span else 0.0
    return TopicInfo(messages.type, len(times), rate)
