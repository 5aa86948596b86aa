"""Intact records of a damaged file, and its messages batch by batch."""

import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema

from selfmodel.logs.mcap.contents import Messages, is_seals, messages_of
from selfmodel.logs.mcap.framing import ContradictionError
from selfmodel.logs.mcap.provenance import Seal, parse_seal
from selfmodel.logs.records import DIGEST, sha256, without_digest


@dataclass
class Findings:
    """Intact records of a file, in the order of the file.

    Attributes:
        records: Texts of the metadata records of selfmodel by name and digest.
        files: Attached files by name and SHA-256.
        schemas: First schema of each number.
        channels: First channel of each number.
        messages: Messages of all channels.
    """

    records: dict[str, dict[str, Mapping[str, str]]] = field(default_factory=dict)
    files: dict[str, dict[str, bytes]] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)

    def add(self, record: McapRecord) -> None:
        """Adds an intact record."""
        if isinstance(record, Message):
            self.messages.append(record)
        elif isinstance(record, Metadata):
            texts = without_digest(record.name, record.metadata)
            self.records.setdefault(record.name, {})[record.metadata[DIGEST]] = texts
        elif isinstance(record, Attachment):
            self.files.setdefault(record.name, {})[sha256(record.data)] = record.data
        elif isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)


@dataclass(frozen=True)
class Group:
    """Messages of a batch, as found.

    Attributes:
        messages: Messages in the order of the file.
        seal: Seal after the messages; None for messages that no seal covers.
    """

    messages: list[Message]
    seal: Seal | None


class Channels:
    """Channels of the found messages.

    Args:
        found: Intact records.

    Attributes:
        topics: Topics by channel number, without that of the seals.
        keys: ``topic_key`` by channel number.
    """

    def __init__(self, found: Findings) -> None:
        self.topics: dict[int, str] = {}
        self.keys: dict[int, bytes] = {}
        self._empty: dict[int, Messages] = {}
        self._seals: set[int] = set()
        for number, channel in found.channels.items():
            if channel.schema_id not in found.schemas:
                continue
            messages = messages_of(channel, found.schemas)
            self.keys[number] = messages.key(channel.topic)
            if is_seals(channel.topic, messages):
                self._seals.add(number)
            elif channel.topic not in self.topics.values():
                self.topics[number] = channel.topic
                self._empty[number] = messages

    def groups(self, messages: Iterable[Message]) -> Iterator[Group]:
        """Yields messages in groups, each up to its seal; of equal messages, the first counts."""
        unsealed: dict[tuple[int, int, bytes], Message] = {}
        for message in messages:
            if message.channel_id not in self._seals:
                key = (message.channel_id, message.log_time, message.data)
                unsealed.setdefault(key, message)
                continue
            try:
                seal = parse_seal(message.data, message.log_time)
            except (ValueError, struct.error):
                continue  # the messages before it remain without a seal
            pending = list(unsealed.values())
            start = max(0, len(pending) - seal.messages)
            if start:
                yield Group(pending[:start], None)
            yield Group(pending[start:], seal)
            unsealed.clear()
        if unsealed:
            yield Group(list(unsealed.values()), None)

    def by_topic(self, messages: Iterable[Message]) -> dict[str, Messages]:
        """Returns messages by topic, in the order of their times and without duplicates.

        Raises:
            ContradictionError: There are two different messages of one topic and time.
        """
        firsts: dict[tuple[int, int], Message] = {}
        for message in messages:
            first = firsts.setdefault((message.channel_id, message.log_time), message)
            if first.data != message.data:
                raise ContradictionError(
                    f"it has two different messages of time {message.log_time} ns"
                )
        for (number, time), message in sorted(firsts.items(), key=lambda item: item[0]):
            if number in self._empty:
                self._empty[number].payloads.append(message.data)
                self._empty[number].times.append((time, message.publish_time))
        return {topic: self._empty[number] for number, topic in self.topics.items()}
