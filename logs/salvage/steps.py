"""Control steps of a damaged log: the complete ones, and the lost messages of the others."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from selfmodel.logs.errors import CorruptError, SchemaMismatchError
from selfmodel.logs.mcap.contents import Contents
from selfmodel.logs.messages.schemas import schema_text
from selfmodel.logs.messages.signals import read_names
from selfmodel.logs.messages.topics import (
    DESCRIPTION,
    DESCRIPTION_TYPE,
    TIMING,
    TRANSFORMS,
    TRANSFORMS_TYPE,
    Topic,
    frames_stride,
    topics,
)
from selfmodel.logs.records import SALVAGE, TIMED_FORMAT, TrialRecord
from selfmodel.logs.salvage.belonging import Discarded


def complete_steps(
    path: Path,
    contents: Contents,
    record: TrialRecord,
    discarded: Sequence[Discarded],
) -> tuple[tuple[Topic, ...], set[int]]:
    """Returns the topics of the steps, and the steps with a message of the trial on every topic.

    Args:
        path: The log.
        contents: Intact contents of one trial.
        record: Record of the trial.
        discarded: Messages that are left out, for an error message.

    Raises:
        CorruptError: No step is complete, or there are more steps than a log may have.
    """
    try:
        every = topics(read_names(path, contents), record.root)
        if record.format == TIMED_FORMAT:
            every = (*every, TIMING)
    except SchemaMismatchError as error:
        raise _nothing(path, discarded) from error
    if record.steps > 100_000:
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
    if span * sum(len(topic.template.payload) for topic in every) > 2**30:
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


def fill(contents: Contents, topic: Topic, steps: int, record: TrialRecord) -> int:
    """Fills the missing messages of a topic with NaN, and returns their number.

    Args:
        contents: Contents, which are changed in place.
        topic: The topic.
        steps: Number of steps to fill.
        record: Record of the trial.
    """
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


def cut(contents: Contents, names: set[str], steps: int, record: TrialRecord) -> None:
    """Removes messages after the last complete step, and topics that selfmodel does not write.

    Args:
        contents: Contents, which are changed in place.
        names: Names of the topics of the steps.
        steps: Number of steps to keep.
        record: Record of the trial.
    """
    end = _time_of(steps, record)
    for name in set(contents.topics) - names - {TRANSFORMS, DESCRIPTION}:
        del contents.topics[name]
    for messages in contents.topics.values():
        kept = [k for k, (log, _) in enumerate(messages.times) if log < end]
        messages.payloads = [messages.payloads[k] for k in kept]
        messages.times = [messages.times[k] for k in kept]


def drop_foreign_displays(contents: Contents) -> None:
    """Removes topics for viewers whose messages are not of the type that selfmodel writes."""
    for name, kind in ((TRANSFORMS, TRANSFORMS_TYPE), (DESCRIPTION, DESCRIPTION_TYPE)):
        held = contents.topics.get(name)
        if held and (held.type, held.schema) != (kind, schema_text(kind).encode()):
            del contents.topics[name]


def missing_frames(contents: Contents, span: int, record: TrialRecord) -> int:
    """Returns the number of missing messages on ``/tf``."""
    stride = frames_stride(record.control_timestep)
    held = contents.topics.get(TRANSFORMS)
    return len(range(0, span, stride)) - (len(held.payloads) if held else 0)


def _time_of(step: int, record: TrialRecord) -> int:
    return round(step * record.control_timestep * 1e9)
