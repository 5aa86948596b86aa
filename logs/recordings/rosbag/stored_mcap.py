"""Reader of the MCAP file of a bag, in one pass.

Recorders write no checksums and, with some presets, no index, and the file may be part of a split
recording. Unlike in a trial log, none of these is required; checksums other than 0 and the count
of messages are verified.
"""

import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import zstandard
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Channel, Message, Schema, Statistics
from mcap.stream_reader import StreamReader

from selfmodel.logs.errors import CorruptError, LogError, NotMcapError, TruncatedError
from selfmodel.logs.recordings.rosbag.bounded_file import BoundedFile
from selfmodel.logs.recordings.rosbag.stored import (
    Announced,
    DamageError,
    Stored,
    checked_time,
    explained,
)

ADVICE = "record it again, or recover its intact part with `mcap recover`"

_FAILURES = (
    McapError,
    ValueError,  # checksums, invalid text, and DamageError
    RuntimeError,  # lz4
    struct.error,
    zstandard.ZstdError,
    OverflowError,
)
"""Exceptions that the mcap library and its decompressors raise for damaged bytes."""


def read_mcap(path: Path, name: Path) -> Iterator[Announced | Stored]:
    """Yields the records of a file, in order.

    The file is undamaged if the iteration ends without an exception.

    Args:
        path: The file.
        name: Name of the file in errors: the name before decompression.

    Raises:
        LogError: The file is damaged or ends too early.
        OSError: The file cannot be read.
    """
    with BoundedFile(path) as file:
        yield from explained(_items(file), _FAILURES, partial(_error, name))


def _items(file: BoundedFile) -> Iterator[Announced | Stored]:
    schemas: dict[int, str] = {}
    topics: dict[int, Announced] = {}
    count = 0
    claimed: int | None = None
    for record in StreamReader(file, validate_crcs=True, record_size_limit=None).records:
        if isinstance(record, Message):
            count += 1
            if record.channel_id not in topics:
                raise DamageError(f"a message is of channel {record.channel_id}, which is unknown")
            yield Stored(topics[record.channel_id], checked_time(record.log_time), record.data)
        elif isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            kind = schemas.get(record.schema_id, "")  # 0: no schema
            topics[record.id] = Announced(record.topic, kind, record.message_encoding)
            yield topics[record.id]
        elif isinstance(record, Statistics):
            claimed = record.message_count
    # The library skips records of a damaged type: the messages would be missing silently.
    if claimed is not None and claimed != count:
        raise DamageError(f"its statistics have {claimed} messages, its records {count}")
    if file.read(1):
        raise DamageError("bytes follow its end")


def _error(name: Path, failure: Exception, good: str) -> LogError:
    if isinstance(failure, InvalidMagic):
        return NotMcapError(
            name, "its first or last bytes are not those of MCAP", good=good, advice=ADVICE
        )
    if isinstance(failure, (EndOfFile, struct.error)):
        return TruncatedError(name, "the file ends too early", good=good, advice=ADVICE)
    what = f"the file is damaged: {failure or type(failure).__name__}"
    return CorruptError(name, what, good=good, advice=ADVICE)
