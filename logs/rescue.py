"""Finds what is whole in a damaged file: records whose own checksum holds, wherever they lie."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema

from selfmodel.logs.budget import Budget, ExcessError
from selfmodel.logs.contents import FILE_LIMIT, Contents, Messages, messages_of, read_bytes
from selfmodel.logs.errors import ANOTHER, CorruptError, NotMcapError, UnsupportedError
from selfmodel.logs.framing import (
    FAILURES,
    MAGIC,
    ContradictionError,
    Frame,
    UncheckedError,
    frames,
    parse,
    unpack,
)
from selfmodel.logs.records import OWN, without_digest


def rescue(path: Path) -> Contents:
    """Returns what a damaged log has that is known to be whole.

    That is every chunk and attachment whose checksum holds, and every record of ours whose digest
    does. After bytes that make no sense, the next record that does is looked for. What stands in
    the file twice counts once.

    Args:
        path: The file; it is only read.

    Raises:
        LogError: It is too large, has nothing of a log, or says two different things of one
            message.
        InputError: There is no such file, or it cannot be opened.
    """
    found = _Found()
    try:
        for record in _whole(read_bytes(path)):
            found.add(record)
        contents = found.contents()
    except ContradictionError as error:
        raise CorruptError(path, f"nothing can be salvaged: {error}") from error
    except ExcessError as error:
        what = f"nothing can be salvaged: {error}"
        raise UnsupportedError(path, what, advice=ANOTHER) from error
    if not contents.metadata:
        raise NotMcapError(path, "nothing in this file is of a trial log", advice=ANOTHER)
    return contents


@dataclass
class _Found:
    """What has been found so far; of two things with one name, the first."""

    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: dict[tuple[int, int], Message] = field(default_factory=dict)

    def add(self, record: McapRecord) -> None:
        if isinstance(record, Metadata):
            texts = without_digest(record.name, record.metadata)
            self.metadata.setdefault(record.name, texts)
        elif isinstance(record, Attachment):
            self.attachments.setdefault(record.name, record.data)
        elif isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Message):
            self._add_message(record)

    def _add_message(self, message: Message) -> None:
        first = self.messages.setdefault((message.channel_id, message.log_time), message)
        if first.data != message.data:
            raise ContradictionError(f"it has two different messages of time {message.log_time} ns")

    def contents(self) -> Contents:
        """Returns all of it, as a sound file would have it."""
        topics: dict[str, Messages] = {}
        by_channel: dict[int, Messages] = {}
        for number, channel in self.channels.items():
            if channel.schema_id in self.schemas and channel.topic not in topics:
                by_channel[number] = messages_of(channel, self.schemas)
                topics[channel.topic] = by_channel[number]
        for (number, time), message in sorted(self.messages.items(), key=lambda item: item[0]):
            if number in by_channel:
                by_channel[number].payloads.append(message.data)
                by_channel[number].times.append((time, message.publish_time))
        return Contents("ros2", self.metadata, self.attachments, topics)


def _whole(data: bytes) -> Iterator[McapRecord]:
    """Yields what is whole; schemas and channels that no chunk vouches for come last."""
    bare: list[McapRecord] = []
    work = _Work()
    offset = len(MAGIC)
    while offset < len(data):
        try:
            frame = next(frames(data, offset))
            records = _vouched(frame, work)
        except ExcessError:
            raise
        except FAILURES:
            offset = _next_whole(data, offset + 1, work, len(data))
            continue
        if frame.opcode in _VOUCHED and records:
            yield from records
            offset = frame.end
        else:
            bare += records
            # Nothing vouches for its length: it may have swallowed what is whole.
            offset = _next_whole(data, frame.offset + 1, work, frame.end)
    yield from bare


_VOUCHED = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)


class _Work:
    """Counts what was tried, in vain or not: bytes can be such that every one begins a record."""

    def __init__(self) -> None:
        self.budget = Budget()
        self._tried = 0

    def attempt(self, frame: Frame) -> None:
        self.budget.frame(frame.opcode, len(frame.body))
        self._tried += len(frame.body)
        if self._tried > _MOST_TRIED:
            raise ExcessError("too much of it looks like a log and is none")


_MOST_TRIED = 4 * FILE_LIMIT
_BEGINNING = re.compile(rb"[\x06\x09\x0c](?=.{3}[\x00-\x10]\x00{4})", re.DOTALL)
"""How a chunk, an attachment or a record of ours begins: what it is, and a length that a file may
have."""


def _vouched(frame: Frame, work: _Work) -> list[McapRecord]:
    """The records of a frame that are what was written, as far as their checksums can say.

    Raises:
        Exception: One of ``FAILURES``: they are not.
    """
    work.attempt(frame)
    record = parse(frame)
    if isinstance(record, Chunk):
        return unpack(record, work.budget)
    if isinstance(record, Attachment) and not any(frame.body[-4:]):
        raise UncheckedError("an attachment has no checksum")
    if isinstance(record, Metadata):
        if not record.name.startswith(OWN):
            return []
        without_digest(record.name, record.metadata)
    kept = isinstance(record, (Attachment, Metadata, Schema, Channel))
    return [record] if kept and record is not None else []


def _next_whole(data: bytes, offset: int, work: _Work, end: int) -> int:
    """Where the next chunk, attachment or record of ours begins that is whole; or ``end``."""
    for match in _BEGINNING.finditer(data, offset, end):
        try:
            if _vouched(next(frames(data, match.start())), work):
                return match.start()
        except ExcessError:
            raise
        except FAILURES:
            continue
    return end
