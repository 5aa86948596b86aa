"""Recording of a robot: series of numbers by topic, of a bag or of a table."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.isolation import Message

IntArray = NDArray[np.int64]

TABLE = "table"
"""Topic of all columns of a table, which have their times in common."""

MAX_TIME = 2**62
"""Magnitude of a time above which it is refused, ns: the year 2116; sums still fit 64 bits."""


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of one name on a topic.

    Attributes:
        index: Indices of the messages with that name, ``(m,)``.
        values: Numbers, ``(m, width)``.
    """

    index: IntArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Series:
    """Messages of a topic, or the rows of a table.

    Attributes:
        type: Message type, such as ``sensor_msgs/msg/JointState``, or format of the table.
        count: Number of messages or rows.
        stamps: Time stamps of the decoded messages, ``(n,)`` ns; 0 without a stamp.
        logged: Log times, ``(n,)`` ns; the time column of a table.
        places: Places of these messages among all of the recording, ``(n,)``, increasing.
        names: Names of all columns.
        columns: Columns by name, those that were read; each message may have other names.
        refused: Numbers of messages left out, by reason.
        by_place: Whether the columns are numbers of a type without a role, which are named by their
            place in a message.
    """

    type: str
    count: int
    stamps: IntArray
    logged: IntArray
    places: IntArray
    names: tuple[str, ...]
    columns: Mapping[str, Column]
    refused: Mapping[str, int]
    by_place: bool = False


@dataclass(frozen=True, eq=False)
class Recording:
    """Content of a bag or of a table.

    Attributes:
        series: Series by topic; ``TABLE`` is the only topic of a table.
        digests: SHA-256 of each file by its name: most recorders write no checksums.
        notes: Warnings about the files, one sentence each.
    """

    series: Mapping[str, Series]
    digests: Mapping[str, str]
    notes: tuple[str, ...] = ()


def packed(recording: Recording) -> Message:
    """Returns a recording as a message between processes."""

    def encoded(array: NDArray[Any]) -> tuple[str, tuple[int, ...], bytes]:
        return array.dtype.str, array.shape, array.tobytes()

    return Message({}, {"content": msgspec.msgpack.encode(recording, enc_hook=encoded)})


def unpacked(message: Message) -> Recording:
    """Returns the recording that ``packed`` has packed."""

    def decoded(_kind: type, item: tuple[str, tuple[int, ...], bytes]) -> NDArray[Any]:
        dtype, shape, data = item
        return np.frombuffer(data, dtype=dtype).reshape(shape)

    return msgspec.msgpack.decode(message.buffers["content"], type=Recording, dec_hook=decoded)
