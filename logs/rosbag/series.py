"""Messages of topics as columns of numbers by name."""

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
        values: Numbers, ``(m, width)``; see ``KINDS``.
    """

    index: IndexArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Series:
    """Messages of a topic.

    Attributes:
        topic: The topic.
        stamps: Time stamps, ``(n,)`` ns; 0 without a stamp.
        logged: Log times, ``(n,)`` ns.
        columns: Columns by name; each message may have other names.
        refused: Numbers of messages left out, by reason.
    """

    topic: Topic
    stamps: IntArray
    logged: IntArray
    columns: Mapping[str, Column]
    refused: Mapping[str, int]


def read_series(bag: Bag, wanted: Collection[str]) -> dict[str, Series]:
    """Returns the messages of some topics of a bag, in one pass.

    Args:
        bag: The bag.
        wanted: Names of topics of the bag, of types in ``KINDS``.

    Raises:
        LogError: A message is damaged, or has an unknown encoding.
    """
    for name in wanted:
        if bag.topics[name].encoding != "cdr":
            raise UnsupportedError(
                bag.path,
                f"expected messages in cdr on {name}, got {bag.topics[name].encoding!r}",
                advice="record it with an RMW that uses DDS",
            )
    gathered = {name: _Gathered() for name in wanted}
    for name, time, payload in bag.messages(wanted):
        try:
            stamp, rows = read_message(payload, bag.topics[name].type)
        except RefusedError as refused:
            gathered[name].refused[str(refused)] += 1
        except UndecodableError as failure:
            raise CorruptError(
                bag.path, f"a message on {name} is damaged: {failure}", advice="record it again"
            ) from failure
        else:
            gathered[name].add(stamp, time, rows)
    return {name: found.series(bag.topics[name]) for name, found in gathered.items()}


@dataclass
class _Gathered:
    stamps: list[int] = field(default_factory=list)
    logged: list[int] = field(default_factory=list)
    # By the names in a message, nearly always the names of the message before.
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
