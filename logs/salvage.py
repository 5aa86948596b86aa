"""Salvage: a new log with the steps of a damaged or unfinished log before its first damage."""

import dataclasses
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import encodable, file_digest
from selfmodel.logs.contents import Contents, Messages, read_undamaged
from selfmodel.logs.decoding import read_behaviour, read_names
from selfmodel.logs.errors import CorruptError, LogError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.log_file import LogFile
from selfmodel.logs.reader import interpret, read_controller, read_log, read_record
from selfmodel.logs.records import (
    INTERRUPTED,
    OWN,
    RESULT,
    SALVAGE,
    TIMED_FORMAT,
    TRIAL,
    Result,
    TrialRecord,
)
from selfmodel.logs.topics import DESCRIPTION, TIMING, TRANSFORMS, topics
from selfmodel.trials.behaviour import forward_displacement

_SEALED = "selfmodel.manifest"
"""Record of a log that version 0.1 wrote; it is not of the new log."""


@dataclass(frozen=True)
class Salvaged:
    """Result of a salvage.

    Attributes:
        log: New file.
        steps: Number of steps in the new log: those before the first damage.
        planned: Planned number of steps.
        damage: The first damage of the old log.
    """

    log: str
    steps: int
    planned: int
    damage: str


def salvage(path: Path, out: Path) -> Salvaged:
    """Writes the steps before the first damage of a log into a new, valid one.

    Args:
        path: The log; it is only read.
        out: The new log, whose status is ``interrupted``.

    Raises:
        LogError: No step is complete before the first damage.
        InputError: The log is valid, ``out`` exists, or ``path`` does not.
        LogWriteError: The disk is full, or failed.
    """
    refuse_existing(out)
    _refuse_sound(path)
    contents, result, saved = _saved(path)
    _write(out, contents, result)
    return dataclasses.replace(saved, log=str(out))


def salvageable_steps(path: Path) -> int:
    """Returns the number of steps that ``salvage`` would write.

    Args:
        path: The log; it is only read.

    Raises:
        InputError: The file does not exist.
    """
    try:
        return _saved(path)[2].steps
    except LogError:
        return 0


def _refuse_sound(path: Path) -> None:
    try:
        status = read_log(path).status
    except LogError:
        return
    raise InputError(
        f"{path} is valid, and the trial in it is {status}: there is nothing to salvage"
    )


def _saved(path: Path) -> tuple[Contents, Result, Salvaged]:
    """Contents and result of the new log, checked as a reader would check them."""
    contents, damage = read_undamaged(path)
    reason = damage.what if damage else "the trial did not finish"
    record = read_record(path, contents)
    controller = read_controller(path, contents, record)
    steps = _cut(path, contents, record, reason)
    behaviour = read_behaviour(path, contents, record, steps, controller)
    result = Result(INTERRUPTED, steps, float(forward_displacement(behaviour)))
    contents.metadata = {
        name: texts
        for name, texts in contents.metadata.items()
        if name.startswith(OWN) and name != _SEALED
    } | {
        TRIAL: record.texts(),
        RESULT: result.texts(),
        SALVAGE: {
            "source": encodable(path.name),
            "source_sha256": file_digest(path),
            "complete_steps": str(steps),
        },
    }
    interpret(path, contents)
    return contents, result, Salvaged("", steps, record.steps, reason)


def _cut(path: Path, contents: Contents, record: TrialRecord, reason: str) -> int:
    """Removes what is not of the complete first steps, and returns their number.

    Raises:
        CorruptError: Not one step is complete.
    """
    nothing = CorruptError(path, f"nothing can be salvaged before its first damage: {reason}")
    try:
        every = topics(read_names(path, contents), record.root)
    except LogError as error:
        raise nothing from error
    names = [topic.name for topic in (*every, *([TIMING] if record.format == TIMED_FORMAT else []))]
    held = [contents.topics.get(name) for name in names]
    steps = min(0 if messages is None else _first_steps(messages, record) for messages in held)
    if not steps:
        raise nothing
    end = _time_of(steps, record)
    for name, messages in list(contents.topics.items()):
        if name not in (*names, TRANSFORMS, DESCRIPTION):
            del contents.topics[name]
            continue
        kept = sum(time < end for time, _ in messages.times)
        del messages.payloads[kept:], messages.times[kept:]
    return steps


def _first_steps(messages: Messages, record: TrialRecord) -> int:
    """Number of messages before the first one that is missing."""
    for k, (time, _) in enumerate(messages.times):
        if time != _time_of(k, record):
            return k
    return len(messages.times)


def _time_of(step: int, record: TrialRecord) -> int:
    return round(step * record.control_timestep * 1e9)


def _write(out: Path, contents: Contents, result: Result) -> None:
    log = LogFile(out)
    with ExitStack() as undo:
        undo.callback(log.abandon)  # on any error; the damaged file is unchanged
        for name, texts in contents.metadata.items():
            if name != RESULT:
                log.metadata(name, texts)
        for name, data in contents.attachments.items():
            log.attach(name, data)
        channels = [log.channel(name, held.type) for name, held in contents.topics.items()]
        rows = [
            (0, index, time, payload)
            for index, held in enumerate(contents.topics.values())
            for payload, (time, _) in zip(held.payloads, held.times, strict=True)
        ]
        log.messages(channels, sorted(rows, key=lambda row: (row[2], row[1])))
        log.finish(result)
        undo.pop_all()
