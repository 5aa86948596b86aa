"""Reader of a ROS 1 bag (``.bag``, format 2.0), whose chunks may be compressed."""

import os
import shlex
import struct
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rosbags.rosbag1 import Reader, ReaderError

from selfmodel.logs.errors import CorruptError, IncompleteError, LogError
from selfmodel.logs.recordings.rosbag.bounded_file import BoundedFile, BoundedPath
from selfmodel.logs.recordings.rosbag.message_types import ROS1
from selfmodel.logs.recordings.rosbag.stored import (
    Announced,
    DamageError,
    Stored,
    checked_time,
    explained,
)

if TYPE_CHECKING:
    from rosbags.interfaces.typing import RPath

ROS1_MAGIC = b"#ROSBAG V"

_FAILURES = (
    ReaderError,
    AssertionError,  # the library's checks of the index
    LookupError,
    ValueError,  # invalid text, and DamageError
    OverflowError,
    RuntimeError,  # lz4
    EOFError,  # bz2
    OSError,  # bz2, and a position beyond every file
    struct.error,
)
"""Exceptions that the rosbags library and its decompressors raise for damaged bytes."""


def read_ros1(path: Path, name: Path) -> Iterator[Announced | Stored]:
    """Returns the records of a file: topics, then messages in the order of their log times.

    Args:
        path: The file.
        name: Name of the file in errors: the name before decompression.

    Raises:
        LogError: The file is damaged, ends too early, or has no index.
    """
    return explained(_items(path), _FAILURES, partial(_error, name))


def _items(path: Path) -> Iterator[Announced | Stored]:
    with Reader(cast("RPath", BoundedPath(path))) as reader:
        topics = {
            connection.id: Announced(connection.topic, connection.msgtype, ROS1)
            for connection in reader.connections
        }
        yield from topics.values()
        if len(reader.chunks) != len(reader.chunk_infos):
            raise DamageError("its index lists a chunk twice")
        if (claimed := len(reader.chunk_infos)) != (listed := _chunk_infos(path)):
            raise DamageError(f"its header has {claimed} chunks, its index {listed}")
        # The chunks have counts of their own, by connection.
        expected: Counter[int] = Counter()
        for chunk in reader.chunk_infos:
            expected.update(chunk.connection_counts)
        found: Counter[int] = Counter()
        for connection, time, payload in reader.messages():
            found[connection.id] += 1
            yield Stored(topics[connection.id], checked_time(time), payload)
        if found != expected:
            raise DamageError(
                f"its chunks have {expected.total()} messages, its index {found.total()}, or of "
                f"other connections"
            )


def _chunk_infos(path: Path) -> int:
    """Number of chunks in the index, which the library reads up to the number in the header."""
    count = 0
    with BoundedFile(path) as file:
        header = file.read(_HEADER_BYTES)
        file.seek(*_POSITION.unpack_from(header, header.index(_INDEX_POSITION) + 10))
        while size := file.read(_LENGTH.size):
            header = file.read(*_LENGTH.unpack(size))
            (length,) = _LENGTH.unpack(file.read(_LENGTH.size))
            count += _CHUNK_INFO in header
            file.seek(length, os.SEEK_CUR)
    return count


_LENGTH = struct.Struct("<I")
_POSITION = struct.Struct("<Q")
_INDEX_POSITION = b"index_pos="
_HEADER_BYTES = 4096
"""Size of the version and of the header of a bag, which is padded to at least that, bytes."""

_CHUNK_INFO = b"\x04\0\0\0op=\x06"
"""Field of the header of a chunk's entry in the index."""


def _error(name: Path, failure: Exception, good: str) -> LogError:
    again = f"`rosbag reindex {shlex.quote(name.name)}`"
    if "not indexed" in str(failure):
        return IncompleteError(
            name, "its recorder did not close it: it has no index", advice=f"add one with {again}"
        )
    reason = failure or type(failure).__name__
    return CorruptError(
        name,
        f"the file is damaged, or ends too early: {reason}",
        good=good,
        advice=f"record it again, or recover its intact part with {again}",
    )
