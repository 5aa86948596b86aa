"""Messages of topics as columns of numbers, by name."""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.logs.errors import CorruptError, UnsupportedError
from selfmodel.logs.rosbag.bag import Bag, Topic
from selfmodel.logs.rosbag.messages import RefusedError, Rows, UndecodableError, read_message

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of one name on a topic.

    Attributes:
        index: Indices of the messages with that name, ``(m,)``.
        values: Rows of these messages, ``(m, width)``; see ``KINDS``.
    """

    index: IndexArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Series:
    """The messages of a topic.

    Attributes:
        topic: The topic.
        stamps: Measurement time in the header of each message, ``(n,)`` ns; 0 for messages
            without a header.
        logged: Time of reception of each message, ``(n,)`` ns.
        columns: Columns by the names in the messages; the names may differ between messages.
        refused: Number of dropped messages, by reason.
    """

    topic: Topic
    stamps: IntArray
    logged: IntArray
    columns: Mapping[str, Column]
    refused: Mapping[str, int]


def read_series(bag: Bag, wanted: Collection[str]) -> dict[str, Series]:
    """Returns the messages of some topics of a bag, read in one pass.

    Args:
        bag: The recording.
        wanted: Names of topics of the bag, of types in ``KINDS``.

    Raises:
        LogError: A message is damaged, or its encoding is not CDR.
    """
    for name in wanted:
        if bag.topics[name].encoding != "cdr":
            raise UnsupportedError(
                bag.path,
                f"expected messages in cdr on {name}, got {bag.topics[name].encoding!r}",
                advice="record it with an RMW that uses DDS",
            )
    builders = {name: _SeriesBuilder() for name in wanted}
    for name, time, payload in bag.messages(wanted):
        try:
            stamp, rows = read_message(payload, bag.topics[name].type)
        except RefusedError as refused:
            builders[name].refused[str(refused)] += 1
        except UndecodableError as failure:
            raise CorruptError(
                bag.path, f"a message on {name} is damaged: {failure}", advice="record it again"
            ) from failure
        else:
            builders[name].add(stamp, time, rows)
    return {name: found.series(bag.topics[name]) for name, found in builders.items()}


@dataclass
class _SeriesBuilder:
    """Collects the messages of a topic one by one."""

    stamps: list[int] = field(default_factory=list)
    logged: list[int] = field(default_factory=list)
    # Keyed by the names in a message, which rarely change between messages.
    layouts: dict[tuple[str, ...], tuple[list[int], list[FloatArray]]] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)

    def add(self, stamp: int, time: int, rows: Rows) -> None:
        names, values = rows
        indices, blocks = self.layouts.setdefault(names, ([], []))
        indices.append(len(self.stamps))
        blocks.append(values)
        self.stamps.append(stamp)
        self.logged.append(time)

    def series(self, topic: Topic) -> Series:
        parts: dict[str, list[tuple[IndexArray, FloatArray]]] = {}
        for names, (indices, blocks) in self.layouts.items():
            index, stacked = np.array(indices, dtype=np.intp), np.stack(blocks)
            for k, name in enumerate(names):
                parts.setdefault(name, []).append((index, stacked[:, k]))
        return Series(
            topic,
            np.array(self.stamps, dtype=np.int64),
            np.array(self.logged, dtype=np.int64),
            {name: _joined(found) for name, found in parts.items()},
            dict(self.refused),
        )


def _joined(parts: list[tuple[IndexArray, FloatArray]]) -> Column:
    index = np.concatenate([index for index, _ in parts])
    order = np.argsort(index)
    return Column(index[order], np.concatenate([values for _, values in parts])[order])
