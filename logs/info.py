"""What is in a log, at a glance."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.logs.contents import Contents, read_contents
from selfmodel.logs.reader import TrialLog, interpret
from selfmodel.logs.records import HIDDEN, IMPORT, SALVAGE
from selfmodel.trials.behaviour import SIGNALS, Signal


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a log.

    Attributes:
        type: Of its messages.
        messages: How many there are.
        rate: Messages a second; 0 for one message.
    """

    type: str
    messages: int
    rate: float


@dataclass(frozen=True, eq=False)
class Info:
    """What is in a log.

    Attributes:
        log: The trial and what belongs to it.
        bytes: Size of the file.
        topics: By name.
        attachments: Size of each, by name.
        records: The names of the metadata records.
        observed: For each signal the share of its numbers that were observed, in [0, 1].
        driver: What drove the robot, in words.
        source: Where an imported or salvaged trial comes from, as the log says; or nothing.
    """

    log: TrialLog
    bytes: int
    topics: Mapping[str, TopicInfo]
    attachments: Mapping[str, int]
    records: tuple[str, ...]
    observed: Mapping[Signal, float]
    driver: str
    source: Mapping[str, str]


def read_info(path: Path) -> Info:
    """Returns what is in a log. What a simulated robot hides is not told.

    Raises:
        LogError: The log is damaged, or no trial log.
        InputError: There is no such file.
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
    )


def hides_truth(info: Info) -> bool:
    """Returns whether the log says what was wrong, for those who score."""
    return HIDDEN in info.records


def _topic(contents: Contents, name: str) -> TopicInfo:
    messages = contents.topics[name]
    times = [time for time, _ in messages.times]
    span = (times[-1] - times[0]) * 1e-9 if len(times) > 1 else 0.0
    rate = (len(times) - 1) / span if span else 0.0
    return TopicInfo(messages.type, len(times), rate)
