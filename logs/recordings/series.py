"""Messages of topics as columns of numbers by name."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray, IndexArray

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Source:
    """File of a recording.

    Attributes:
        name: Name within the recording.
        sha256: SHA-256 of the file, in hexadecimal: recorders write no checksums.
    """

    name: str
    sha256: str


@dataclass(frozen=True)
class Topic:
    """Topic of a bag.

    Attributes:
        name: Name, such as ``/joint_states``.
        type: Message type, such as ``sensor_msgs/msg/JointState``; "" if unknown.
        encoding: Encoding of the messages; see ``ENCODINGS``.
        count: Number of messages.
    """

    name: str
    type: str
    encoding: str
    count: int


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


@dataclass(frozen=True, eq=False)
class Layout:
    """Messages of a topic with the same names, nearly always all of them.

    Attributes:
        names: Names in each message.
        index: Indices of the messages, ``(m,)``.
        values: Numbers, ``(m, names, width)``; see ``KINDS``.
    """

    names: tuple[str, ...]
    index: IndexArray
    values: FloatArray


def columns_of(layouts: Iterable[Layout]) -> dict[str, Column]:
    """Returns the columns of a topic by name, each in the order of the messages."""
    parts: dict[str, list[Column]] = {}
    for layout in layouts:
        for k, name in enumerate(layout.names):
            parts.setdefault(name, []).append(Column(layout.index, layout.values[:, k]))
    return {name: _joined(found) for name, found in parts.items()}


def _joined(parts: list[Column]) -> Column:
    if len(parts) == 1:
        return parts[0]
    index = np.concatenate([part.index for part in parts])
    order = np.argsort(index)
    return Column(index[order], np.concatenate([part.values for part in parts])[order])
