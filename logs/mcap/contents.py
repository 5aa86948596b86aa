"""Contents of an MCAP file by name; any damage is a ``LogError``."""

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from mcap.exceptions import EndOfFile, InvalidMagic
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from selfmodel.files import check_regular, read_file
from selfmodel.logs.errors import (
    ANOTHER,
    IMPORT_IT,
    CorruptError,
    LogError,
    NotMcapError,
    TruncatedError,
    UnsupportedError,
    salvage_it,
)
from selfmodel.logs.mcap.chain import Chain
from selfmodel.logs.mcap.checksums import verified_records
from selfmodel.logs.mcap.framing import (
    FAILURES,
    MAGIC,
    ContradictionError,
    UncheckedError,
    UnknownCompressionError,
)
from selfmodel.logs.mcap.provenance import PROVENANCE, SEAL_TYPE, topic_key
from selfmodel.logs.records import DIGEST, OWN, without_digest

MAX_BYTES = 2**32
"""Largest size of a log, bytes; a quadruped's trial of 10 s takes 0.5 MB."""

_Item = TypeVar("_Item")


@dataclass
class Messages:
    """Messages of one channel, in the order of the file.

    Attributes:
        type: Name of the schema, or "".
        schema: Text of the schema.
        encoding: Encoding of the messages, such as ``cdr``.
        payloads: Bytes of the messages.
        times: Log time and publish time of each message, ns.
    """

    type: str
    schema: bytes
    encoding: str
    payloads: list[bytes] = field(default_factory=list)
    times: list[tuple[int, int]] = field(default_factory=list)

    def key(self, topic: str) -> bytes:
        """Returns the ``topic_key`` of these messages."""
        return topic_key(topic, self.type, self.encoding, self.schema)


@dataclass
class Contents:
    """Records of a file.

    Attributes:
        profile: Profile of the file, such as ``ros2``.
        metadata: Metadata records by name; those of selfmodel without their verified digest.
        attachments: Attached files by name.
        topics: Messages by topic, without the verified seals.
        digest: Digest of the log: SHA-256 over records, files and messages; "" in a log of an
            earlier version.
    """

    profile: str = ""
    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    topics: dict[str, Messages] = field(default_factory=dict)
    digest: str = ""

    @property
    def good(self) -> str:
        """Description of the complete messages, for an error message."""
        counts = [len(messages.payloads) for messages in self.topics.values()]
        return f"{sum(counts)} messages on {len(counts)} topics before that are complete"


def read_contents(path: Path, unread: Collection[str] = ()) -> Contents:
    """Returns the contents of a file after all its checksums have been verified.

    Args:
        path: The file.
        unread: Names of metadata records to ignore.

    Raises:
        LogError: The file is damaged, not MCAP, or contains unsupported records.
        InputError: The file does not exist, or cannot be opened.
    """
    contents = Contents()
    data = read_bytes(path)
    try:
        _gather(verified_records(data), contents, unread)
    except FAILURES as failure:
        raise _explain(path, data, failure, contents) from failure
    return contents


def read_bytes(path: Path) -> bytes:
    """Returns the bytes of a file.

    Raises:
        LogError: The file is too large for a log.
        InputError: The file does not exist, or cannot be opened.
    """
    check_regular(path, "a log file")
    return read_file(path, "a log file", MAX_BYTES)


def _add_once(items: dict[str, _Item], name: str, item: _Item) -> None:
    """Adds an item.

    Raises:
        ContradictionError: An item of that name exists.
    """
    if name in items:
        raise ContradictionError(f"it has {name!r} twice")
    items[name] = item


def _gather(records: Iterator[McapRecord], contents: Contents, unread: Collection[str]) -> None:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Messages] = {}
    digests: dict[str, str] = {}
    chain = Chain()
    for record in records:
        if isinstance(record, Message):
            channels[record.channel_id].payloads.append(record.data)
            channels[record.channel_id].times.append((record.log_time, record.publish_time))
            chain.add(record)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in channels:
            messages = channels[record.id] = messages_of(record, schemas)
            chain.keys[record.id] = messages.key(record.topic)
            if is_seals(record.topic, messages):
                chain.seals = record.id
            else:
                _add_once(contents.topics, record.topic, messages)
        elif isinstance(record, Metadata) and record.name not in unread:
            texts = record.metadata
            if record.name.startswith(OWN):
                texts = without_digest(record.name, record.metadata)
                digests[record.name] = record.metadata[DIGEST]
            _add_once(contents.metadata, record.name, texts)
        elif isinstance(record, Attachment):
            _add_once(contents.attachments, record.name, record.data)
        elif isinstance(record, Header):
            contents.profile = record.profile
    contents.digest = chain.digest(contents.metadata, digests, contents.attachments)


def is_seals(topic: str, messages: Messages) -> bool:
    """Returns whether the messages of a topic are the seals of batches."""
    return topic == PROVENANCE and messages.type == SEAL_TYPE


def messages_of(channel: Channel, schemas: Mapping[int, Schema]) -> Messages:
    """Returns an empty list of messages for a channel.

    Raises:
        KeyError: The schema of the channel is unknown.
    """
    schema = schemas[channel.schema_id] if channel.schema_id else Schema(0, b"", "", "")
    return Messages(schema.name, schema.data, channel.message_encoding)


def _explain(path: Path, data: bytes, failure: Exception, contents: Contents) -> LogError:
    good = contents.good
    if isinstance(failure, InvalidMagic):
        return NotMcapError(path, "this is not an MCAP file", advice=ANOTHER)
    if isinstance(failure, UnknownCompressionError):
        return UnsupportedError(path, str(failure), good=good, advice="pack it again with zstd")
    if isinstance(failure, UncheckedError):
        what = f"{failure}: selfmodel did not write this file"
        return UnsupportedError(path, what, good=good, advice=IMPORT_IT)
    if isinstance(failure, (EndOfFile, struct.error)) and not data.endswith(MAGIC):
        if len(data) <= len(MAGIC):
            return NotMcapError(path, "the file is empty or too short", advice=ANOTHER)
        return TruncatedError(path, "the file ends too early", good=good, advice=salvage_it(path))
    what = f"the file is damaged: {failure or type(failure).__name__}"
    return CorruptError(path, what, good=good, advice=salvage_it(path))
