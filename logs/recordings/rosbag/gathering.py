"""Gathering of a bag's records into arrays."""

from collections import Counter
from collections.abc import Collection
from pathlib import Path

from selfmodel.logs.errors import CorruptError, UnsupportedError
from selfmodel.logs.recordings.rosbag.answer import Decoded
from selfmodel.logs.recordings.rosbag.message_types import CDR, ENCODINGS, full_type
from selfmodel.logs.recordings.rosbag.messages import (
    KINDS,
    RefusedError,
    UndecodableError,
    read_message,
)
from selfmodel.logs.recordings.rosbag.storage import unpacked
from selfmodel.logs.recordings.rosbag.stored import Announced, Stored
from selfmodel.logs.recordings.series import Topic

LONGEST_NAME = 1000
"""Maximum length of a name in a bag, characters."""


class Gathering:
    """Topics of a bag, and the decoded messages of some of them.

    Args:
        path: Path of the bag from the user.
        wanted: Names of the topics whose messages are decoded.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self._path = path
        self._wanted = frozenset(wanted)
        self._announced: dict[str, dict[Announced, None]] = {}
        self._counts: Counter[str] = Counter()
        self._decoded: dict[str, Decoded] = {}

    def add(self, item: Announced | Stored) -> None:
        """Adds a record.

        Raises:
            CorruptError: The message is damaged.
        """
        if isinstance(item, Announced):
            known = self._announced.setdefault(item.topic, {})
            if item not in known:
                known[item] = None
                self._check_names([item.topic, item.type, item.encoding], "of topics")
            return
        name = item.announced.topic
        self._counts[name] += 1
        if name in self._wanted:
            self._decode(item)

    def topics(self) -> dict[str, Topic]:
        """Returns the topics; one of two types or encodings has the names of both."""
        return {
            name: Topic(
                name,
                " and ".join(dict.fromkeys(full_type(item.type) for item in found)),
                " and ".join(dict.fromkeys(item.encoding for item in found)),
                self._counts[name],
            )
            for name, found in self._announced.items()
        }

    def decoded(self) -> dict[str, Decoded]:
        """Returns the messages of the wanted topics of supported types, by topic.

        Raises:
            UnsupportedError: The messages of such a topic have an unknown encoding.
        """
        topics = self.topics()
        wanted = [topics[name] for name in sorted(self._wanted & set(topics))]
        found = [topic for topic in wanted if topic.type in KINDS]
        for topic in found:
            if topic.encoding not in ENCODINGS:
                raise UnsupportedError(
                    self._path,
                    f"expected messages in {' or '.join(ENCODINGS)} on {topic.name}, got "
                    f"{topic.encoding!r}",
                    advice="record it with an RMW that uses DDS",
                )
        return {topic.name: self._decoded.get(topic.name, Decoded()) for topic in found}

    def _decode(self, item: Stored) -> None:
        name, kind = item.announced.topic, full_type(item.announced.type)
        encoding, payload = item.announced.encoding, item.payload
        if kind not in KINDS or encoding not in ENCODINGS:
            return
        if encoding == CDR:
            payload = unpacked(payload, self._path, name)
        messages = self._decoded.setdefault(name, Decoded())
        try:
            stamp, rows = read_message(payload, kind, encoding)
        except RefusedError as refused:
            messages.refused[str(refused)] += 1
        except UndecodableError as failure:
            raise CorruptError(
                self._path, f"a message on {name} is damaged: {failure}", advice="record it again"
            ) from failure
        else:
            names, _ = rows
            if names not in messages.layouts:
                self._check_names(names, f"in the messages on {name}")
            messages.add(stamp, item.time, rows)

    def _check_names(self, texts: Collection[str], where: str) -> None:
        if any(len(text) > LONGEST_NAME for text in texts):
            raise CorruptError(
                self._path,
                f"a name {where} has more than {LONGEST_NAME} characters",
                advice="record it again",
            )
