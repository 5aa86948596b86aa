"""What stands in an MCAP file, by name, with every way of its being damaged as a ``LogError``."""

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from mcap.exceptions import EndOfFile, InvalidMagic
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from selfmodel.errors import InputError
from selfmodel.logs.errors import (
    FROM_PART,
    CorruptError,
    LogError,
    NotMcapError,
    TruncatedError,
    UnsupportedError,
)
from selfmodel.logs.scan import FAILURES, ContradictionError, UnknownCompressionError, scan

_Item = TypeVar("_Item")


@dataclass
class Messages:
    """The messages of one channel, in the order of the file.

    Attributes:
        type: The name of their schema, or "".
        schema: Its text.
        encoding: Such as ``cdr``.
        payloads: The messages.
        times: Log time and publish time of each, ns.
    """

    type: str
    schema: bytes
    encoding: str
    payloads: list[bytes] = field(default_factory=list)
    times: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class Contents:
    """What stands in a file.

    Attributes:
        profile: Which rules the file follows, such as ``ros2``.
        metadata: Records by name.
        attachments: Files by name.
        topics: Messages by topic.
    """

    profile: str = ""
    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    topics: dict[str, Messages] = field(default_factory=dict)

    @property
    def good(self) -> str:
        """Says how much was read."""
        counts = [len(messages.payloads) for messages in self.topics.values()]
        return f"{sum(counts)} messages on {len(counts)} topics before that are complete"


def read_contents(path: Path, unread: Collection[str] = ()) -> Contents:
    """Returns what stands in a file, once all of it is known to be sound.

    Args:
        path: The file.
        unread: Names of metadata records to pass over.

    Raises:
        LogError: The file is damaged, not MCAP, or holds what is not supported.
        InputError: There is no such file, or it cannot be opened.
    """
    contents, error = salvage_contents(path, unread)
    if error is not None:
        raise error
    return contents


def salvage_contents(path: Path, unread: Collection[str] = ()) -> tuple[Contents, LogError | None]:
    """Returns what can be read of a file, and what is wrong with it, if anything.

    Every message that is returned stood in the file whole and, in a log of ours, passed its
    chunk's checksum.

    Raises:
        InputError: There is no such file, or it cannot be opened.
    """
    contents = Contents()
    try:
        with path.open("rb") as file:
            try:
                _gather(scan(file), contents, unread)
            except FAILURES as failure:
                return contents, _explain(path, failure, contents)
    except OSError as failure:
        raise InputError(
            f"{path}: expected a log file that can be read, got: {failure.strerror}"
        ) from failure
    return contents, None


def _gather(records: Iterator[McapRecord], contents: Contents, unread: Collection[str]) -> None:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Messages] = {}
    for record in records:
        if isinstance(record, Message):
            channels[record.channel_id].payloads.append(record.data)
            channels[record.channel_id].times.append((record.log_time, record.publish_time))
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in channels:
            schema = schemas[record.schema_id] if record.schema_id else Schema(0, b"", "", "")
            channels[record.id] = Messages(schema.name, schema.data, record.message_encoding)
            _put(contents.topics, record.topic, channels[record.id])
        elif isinstance(record, Metadata) and record.name not in unread:
            _put(contents.metadata, record.name, record.metadata)
        elif isinstance(record, Attachment):
            _put(contents.attachments, record.name, record.data)
        elif isinstance(record, Header):
            contents.profile = record.profile


def _put(items: dict[str, _Item], name: str, item: _Item) -> None:
    if name in items:
        raise ContradictionError(f"it has {name!r} twice")
    items[name] = item


def _explain(path: Path, failure: Exception, contents: Contents) -> LogError:
    started = bool(contents.metadata or contents.topics or contents.profile)
    if isinstance(failure, InvalidMagic):
        if started:
            return CorruptError(path, "its last bytes are damaged", good=contents.good)
        return NotMcapError(path, "this is not an MCAP file", advice="give a trial log, NAME.mcap")
    if isinstance(failure, (EndOfFile, struct.error)):
        if started:
            return TruncatedError(
                path, "the file ends too early", good=contents.good, advice=FROM_PART
            )
        return NotMcapError(
            path, "the file is empty or too short", advice="give a trial log, NAME.mcap"
        )
    if isinstance(failure, UnknownCompressionError):
        return UnsupportedError(path, str(failure), advice="pack it again with zstd")
    what = f"the file is damaged: {failure or type(failure).__name__}"
    return CorruptError(path, what, good=contents.good)
