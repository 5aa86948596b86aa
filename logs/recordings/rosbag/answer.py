"""Answer of the child process that reads a bag, as a message between processes."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.isolation import Message
from selfmodel.logs.recordings.series import Layout, Series, Source, Topic, columns_of

Rows = tuple[tuple[str, ...], FloatArray]
"""Names in a message, and a row of numbers for each, ``(names, width)``."""


@dataclass(frozen=True)
class Decoded:
    """Decoded messages of one topic.

    Attributes:
        stamps: Time stamp of each message, ns.
        logged: Log time of each message, ns.
        layouts: Indices and rows of the messages by the names in them.
        refused: Numbers of messages left out, by reason.
    """

    stamps: list[int] = field(default_factory=list)
    logged: list[int] = field(default_factory=list)
    layouts: dict[tuple[str, ...], tuple[list[int], list[FloatArray]]] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)

    def add(self, stamp: int, time: int, rows: Rows) -> None:
        """Adds a message."""
        names, values = rows
        indices, blocks = self.layouts.setdefault(names, ([], []))
        indices.append(len(self.stamps))
        blocks.append(values)
        self.stamps.append(stamp)
        self.logged.append(time)


def answer(
    topics: Iterable[Topic], sources: Iterable[Source], decoded: Mapping[str, Decoded]
) -> Message:
    """Returns the answer of the child process.

    Args:
        topics: Topics of the bag.
        sources: Files of the bag.
        decoded: Messages by wanted topic.
    """
    buffers: dict[str, bytes] = {}
    layouts: dict[str, list[tuple[str, ...]]] = {}
    for topic, found in decoded.items():
        buffers[f"stamps {topic}"] = np.array(found.stamps, dtype=np.int64).tobytes()
        buffers[f"logged {topic}"] = np.array(found.logged, dtype=np.int64).tobytes()
        layouts[topic] = [names for names in found.layouts if names]
        for k, names in enumerate(layouts[topic]):
            indices, rows = found.layouts[names]
            buffers[f"index {k} {topic}"] = np.array(indices, dtype=np.int64).tobytes()
            buffers[f"values {k} {topic}"] = b"".join(row.tobytes() for row in rows)
    header = {
        "topics": [(topic.name, topic.type, topic.encoding, topic.count) for topic in topics],
        "sources": [(source.name, source.sha256) for source in sources],
        "layouts": layouts,
        "refused": {topic: found.refused for topic, found in decoded.items()},
    }
    return Message(header, buffers)


def parse_answer(
    header: Mapping[str, Any], buffers: Mapping[str, bytes]
) -> tuple[dict[str, Topic], tuple[Source, ...], dict[str, Series]]:
    """Returns the topics by name, the files, and the messages by wanted topic."""
    topics = {name: Topic(name, *rest) for name, *rest in header["topics"]}
    return (
        topics,
        tuple(Source(*source) for source in header["sources"]),
        {
            topic: Series(
                topics[topic],
                np.frombuffer(buffers[f"stamps {topic}"], dtype=np.int64),
                np.frombuffer(buffers[f"logged {topic}"], dtype=np.int64),
                columns_of(
                    _layout(
                        tuple(names), buffers[f"index {k} {topic}"], buffers[f"values {k} {topic}"]
                    )
                    for k, names in enumerate(layouts)
                ),
                header["refused"][topic],
            )
            for topic, layouts in header["layouts"].items()
        },
    )


def _layout(names: tuple[str, ...], index: bytes, values: bytes) -> Layout:
    messages = np.frombuffer(index, dtype=np.int64)
    numbers = np.frombuffer(values, dtype=np.float64)
    return Layout(names, messages, numbers.reshape(len(messages), len(names), -1))
