"""Messages of topics as columns of numbers by name, and as bytes between processes."""

import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray, IndexArray

IntArray = NDArray[np.int64]


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


def series_bytes(series: Series) -> bytes:
    """Returns the arrays of a series as ``.npz``; those of the columns one after another."""
    columns = list(series.columns.values())
    data = io.BytesIO()
    np.savez(
        data,
        stamps=series.stamps,
        logged=series.logged,
        lengths=np.array([len(column.index) for column in columns], dtype=np.int64),
        index=np.concatenate([np.zeros(0, dtype=np.intp), *[column.index for column in columns]]),
        values=np.concatenate([column.values for column in columns])
        if columns
        else np.zeros((0, 1)),
    )
    return data.getvalue()


def parse_series(topic: Topic, names: list[str], refused: Mapping[str, int], data: bytes) -> Series:
    """Returns the series of ``series_bytes``.

    Args:
        topic: The topic.
        names: Names of the columns.
        refused: Numbers of messages left out, by reason.
        data: The arrays.
    """
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        ends = np.cumsum(arrays["lengths"])[:-1]
        index, values = np.split(arrays["index"], ends), np.split(arrays["values"], ends)
        columns = [Column(*pair) for pair in zip(index, values, strict=True)]
        return Series(
            topic,
            arrays["stamps"],
            arrays["logged"],
            dict(zip(names, columns, strict=False)),  # without names, split returns one part
            refused,
        )
