"""Salvage of a damaged or unfinished log: its complete steps in a new log."""

import dataclasses
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel.errors import InputError
from selfmodel.files import encodable
from selfmodel.logs.belonging import Discarded
from selfmodel.logs.contents import Contents, Messages, read_bytes
from selfmodel.logs.errors import CorruptError, LogError, SchemaMismatchError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.logfile import LogFile
from selfmodel.logs.reader import interpret, read_controller, read_log, read_record
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    INTERRUPTED,
    MANIFEST,
    NONCE,
    RESULT,
    SALVAGE,
    SETTINGS_FILE,
    TIED,
    TIMED_FORMAT,
    TRIAL,
    Result,
    TrialRecord,
    result_record,
    settings_json,
    sha256,
)
from selfmodel.logs.rescue import rescue
from selfmodel.logs.schemas import schema_text
from selfmodel.logs.signals import read_behaviour, read_names
from selfmodel.logs.topics import (
    DESCRIPTION,
    DESCRIPTION_TYPE,
    TIMING,
    TRANSFORMS,
    TRANSFORMS_TYPE,
    Topic,
    frames_stride,
    topics,
)
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import forward_displacement


@dataclass(frozen=True)
class Salvaged:
    """Result of a salvage.

    Attributes:
        log: New file.
        steps: Number of complete steps.
        span: Number of steps in the new log, up to the last complete step.
        planned: Planned number of steps.
        missing: Number of lost messages by topic; they are replaced by NaN (not observed), except
            on ``/tf``, where they are left out.
        lost: Other lost parts. A lost controller is replaced by a playback of the commands, lost
            settings by those of the paper. Other records and files are known to be lost only if the
            trial is tied.
        tied: Whether every saved message is proven to be of this trial. False for a log of an
            earlier version, in which a mixture of two trials cannot be noticed.
        discarded: Intact messages that are of other trials or lack that proof; they are left out.
    """

    log: str
    steps: int
    span: int
    planned: int
    missing: dict[str, int]
    lost: tuple[str, ...]
    tied: bool
    discarded: tuple[Discarded, ...]


def salvage(path: Path, out: Path, budget: Budget = DEFAULT_BUDGET) -> Salvaged:
    """Writes all complete data of a damaged or unfinished log into a new, valid one.

    Args:
        path: The log; it is only read.
        out: The new log, whose status is ``interrupted``.
        budget: Limits of the file.

    Raises:
        LogError: The first records, the model, or every step is lost.
        InputError: The log is valid, ``out`` exists, or ``path`` does not.
        LogWriteError: The disk is full, or failed.
    """
    refuse_existing(out)
    _refuse_sound(path, budget)
    contents, saved = _saved(path, budget)
    _write(out, contents, result_record(contents.metadata[RESULT]))
    return dataclasses.replace(saved, log=str(out))


def salvageable_steps(path: Path, budget: Budget = DEFAULT_BUDGET) -> int:
    """Returns the number of complete steps that ``salvage`` would write.

    Args:
        path: The log; it is only read.
        budget: Limits of the file.

    Raises:
        InputError: The file does not exist.
    """
    try:
        return _saved(path, budget)[1].steps
    except LogError:
        return 0


def _saved(path: Path, budget: Budget) -> tuple[Contents, Salvaged]:
    """Contents of the new log, checked as a reader would check them."""
    rescued = rescue(path, budget)
    contents = rescued.contents
    _drop_foreign_displays(contents)
    record, replaced = _with_what_is_left(path, contents)
    lost = (*replaced, *(name for name in rescued.absent if name not in replaced))
    controller = read_controller(path, contents, record)
    every, whole = _complete(path, contents, record, rescued.discarded, budget)
    span = max(whole) + 1
    missing = {topic.name: _fill(contents, topic, span, record) for topic in every}
    _cut(contents, {topic.name for topic in every}, _time_of(span, record))
    missing[TRANSFORMS] = _missing_frames(contents, span, record)
    behaviour = read_behaviour(path, contents, record, span, controller)
    earlier = contents.metadata.get(SALVAGE, {})
    tied = bool(rescued.identity) and earlier.get(TIED) != "no"
    result = Result(INTERRUPTED, span, float(forward_displacement(behaviour)))
    contents.metadata[RESULT] = result.texts()
    contents.metadata[SALVAGE] = {
        "source": encodable(path.name),
        "source_sha256": sha256(read_bytes(path, budget)),
        "complete_steps": str(len(whole)),
        TIED: "yes" if tied else "no",
    }
    interpret(path, contents)
    lost_messages = {name: count for name, count in missing.items() if count}
    saved = Salvaged(
        log="",
        steps=len(whole),
        span=span,
        planned=record.steps,
        missing=lost_messages,
        lost=lost,
        tied=tied,
        discarded=rescued.discarded,
    )
    return contents, saved


def _refuse_sound(path: Path, budget: Budget) -> None:
    try:
        status = read_log(path, budget).status
    except LogError:
        return
    raise InputError(
        f"{path} is valid, and the trial in it is {status}: there is nothing to salvage"
    )


def _with_what_is_left(path: Path, contents: Contents) -> tuple[TrialRecord, tuple[str, ...]]:
    """Record of the trial, without lost attachments, and the names of the lost parts."""
    record = read_record(path, contents)
    lost = []
    attached = contents.attachments.get(CONTROLLER_FILE, b"")
    if record.controller_sha256 not in ("", sha256(attached)):
        record = dataclasses.replace(record, controller_sha256="")
        contents.attachments.pop(CONTROLLER_FILE, None)
        contents.metadata[TRIAL] = record.texts()
        lost.append(CONTROLLER_FILE)
    contents.metadata[TRIAL] = {NONCE: "", **contents.metadata[TRIAL]}
    if SETTINGS_FILE not in contents.attachments:
        contents.attachments[SETTINGS_FILE] = settings_json(Settings())
        lost.append(SETTINGS_FILE)
    if DESCRIPTION not in contents.topics or not contents.topics[DESCRIPTION].payloads:
        lost.append(DESCRIPTION)
    return record, tuple(lost)


def _complete(
    path: Path,
    contents: Contents,
    record: TrialRecord,
    discarded: Sequence[Discarded],
    budget: Budget,
) -> tuple[tuple[Topic, ...], set[int]]:
    """Topics, and the steps for which every topic has a message of the trial."""
    try:
        every = topics(read_names(path, contents), record.root)
        if record.format == TIMED_FORMAT:
            every = (*every, TIMING)
    except SchemaMismatchError as error:
        raise _nothing(path, discarded) from error
    if record.steps > budget.records // len(every):
        raise CorruptError(path, f"it claims {record.steps} steps, more than a log may have")
    whole = set(range(record.steps))
    for topic in every:
        messages = contents.topics.get(topic.name)
        times = {log for log, _ in messages.times} if messages else set()
        whole = {k for k in whole if _time_of(k, record) in times}
    if whole and SALVAGE in contents.metadata:
        whole -= _filled_in(contents, every, whole, record)
    if not whole:
        raise _nothing(path, discarded)
    span = max(whole) + 1
    # Missing messages are filled in, and may take many times the size of the file.
    if span * sum(len(topic.template.payload) for topic in every) > budget.unpacked_bytes:
        raise CorruptError(path, f"{span} steps of it have more bytes than a log may")
    return every, whole


def _nothing(path: Path, discarded: Sequence[Discarded]) -> CorruptError:
    what = "nothing can be salvaged: not one step of the trial is complete"
    if steps := sum(other.steps for other in discarded):
        what += f", and {steps} other steps in the file are not proven to be of the trial"
    return CorruptError(path, what)


def _filled_in(
    contents: Contents, every: Sequence[Topic], steps: set[int], record: TrialRecord
) -> set[int]:
    """Steps whose messages have no numbers: an earlier salvage filled them in."""
    times = {_time_of(k, record): k for k in steps}
    found = set(steps)
    for topic in every:
        empty = _empty_messages(topic, list(times))
        messages = contents.topics[topic.name]
        found &= {
            times[log]
            for payload, (log, _) in zip(messages.payloads, messages.times, strict=True)
            if empty.get(log) == payload
        }
    return found


def _empty_messages(topic: Topic, times: Sequence[int]) -> dict[int, bytes]:
    """Messages in which nothing was observed, by time."""
    stamps = np.array(times, dtype=np.int64)
    numbers = np.full((len(times), topic.template.width), np.nan)
    return dict(zip(times, topic.template.encode(stamps, numbers), strict=True))


def _fill(contents: Contents, topic: Topic, steps: int, record: TrialRecord) -> int:
    """Fills the missing messages of a topic with NaN; returns their number."""
    messages = contents.topics[topic.name]
    known = {
        log: (payload, publish)
        for payload, (log, publish) in zip(messages.payloads, messages.times, strict=True)
    }
    times = [_time_of(k, record) for k in range(steps)]
    empty = _empty_messages(topic, times)
    rows = [known.get(time, (empty[time], time)) for time in times]
    messages.payloads = [payload for payload, _ in rows]
    messages.times = [(time, publish) for time, (_, publish) in zip(times, rows, strict=True)]
    return len(set(times) - set(known))


def _drop_foreign_displays(contents: Contents) -> None:
    """Removes topics for viewers whose messages are not of the type that selfmodel writes."""
    for name, kind in ((TRANSFORMS, TRANSFORMS_TYPE), (DESCRIPTION, DESCRIPTION_TYPE)):
        held = contents.topics.get(name)
        if held and (held.type, held.schema) != (kind, schema_text(kind).encode()):
            del contents.topics[name]


def _cut(contents: Contents, names: set[str], end: int) -> None:
    """Removes messages after the last complete step, and topics that selfmodel does not write."""
    for name in set(contents.topics) - names - {TRANSFORMS, DESCRIPTION}:
        del contents.topics[name]
    for messages in contents.topics.values():
        kept = [k for k, (log, _) in enumerate(messages.times) if log < end]
        messages.payloads = [messages.payloads[k] for k in kept]
        messages.times = [messages.times[k] for k in kept]


def _missing_frames(contents: Contents, span: int, record: TrialRecord) -> int:
    """Number of missing messages on ``/tf``."""
    stride = frames_stride(record.control_timestep)
    held = contents.topics.get(TRANSFORMS)
    return len(range(0, span, stride)) - (len(held.payloads) if held else 0)


def _time_of(step: int, record: TrialRecord) -> int:
    return round(step * record.control_timestep * 1e9)


def _write(out: Path, contents: Contents, result: Result) -> None:
    log = LogFile(out)
    with ExitStack() as undo:
        undo.callback(log.abandon)  # on any error; the damaged file is unchanged
        for name, texts in contents.metadata.items():
            if name not in (RESULT, MANIFEST):
                log.metadata(name, texts)
        for name, data in contents.attachments.items():
            log.attach(name, data)
        log.begin(contents.metadata[TRIAL]["name"])
        _write_messages(log, contents.topics)
        log.finish(result)
        undo.pop_all()


def _write_messages(log: LogFile, every: dict[str, Messages]) -> None:
    channels = [log.channel(topic, messages.type) for topic, messages in every.items()]
    rows = [
        (0, index, time, payload)
        for index, messages in enumerate(every.values())
        for payload, (time, _) in zip(messages.payloads, messages.times, strict=True)
    ]
    rows.sort(key=lambda row: (row[2], row[1]))
    log.messages(channels, rows)
