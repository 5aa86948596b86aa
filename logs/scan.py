"""One strict pass over an MCAP file that lets no damaged byte through.

The library's own reader checks too little by default: of flipped bits, three in four pass. Here
every checksum that the format has is compared, and the counts too.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import IO

import zstandard
from mcap.exceptions import McapError
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    Metadata,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk

RECORD_LIMIT = 256 * 2**20
"""Bytes that one record may have, packed or not: a damaged length must not fill the memory."""

_FOOTER = 1 + 8 + 8 + 8 + 4  # opcode, length, two offsets, checksum


class ContradictionError(ValueError):
    """Every record can be read, but two of them do not agree."""


class UnknownCompressionError(ValueError):
    """A chunk is packed in a way that is not known here."""


def scan(file: IO[bytes]) -> Iterator[McapRecord]:
    """Yields each record of a file, the ones within chunks in their place, checking all.

    A caller knows that the file is sound when the iteration ends without an exception.

    Args:
        file: Open for reading, at its start; one that can seek.

    Raises:
        McapError, ValueError, RuntimeError, struct.error, zstandard.ZstdError, KeyError,
            MemoryError: Damage, as the library meets it.
    """
    tally = _Tally()
    reader = StreamReader(
        file, emit_chunks=True, validate_crcs=True, record_size_limit=RECORD_LIMIT
    )
    for outer in reader.records:
        for record in _opened(outer):
            tally.add(record)
            yield record
        if isinstance(outer, Chunk):
            tally.counts[Chunk] += 1
        elif isinstance(outer, Footer):
            _check_summary(file, outer)
    if not tally.ended:
        raise ContradictionError("the end of its data is not marked")
    if file.read(1):
        raise ContradictionError("something follows its end")


FAILURES = (
    McapError,
    ValueError,  # CRCValidationError, UnicodeDecodeError and the two above
    RuntimeError,  # lz4
    struct.error,
    zstandard.ZstdError,
    KeyError,
    MemoryError,
    OverflowError,
)
"""Everything that the library and its decompressors raise over damaged bytes."""


def _opened(record: McapRecord) -> list[McapRecord]:
    if not isinstance(record, Chunk):
        return [record]
    if record.compression not in ("", "zstd", "lz4"):
        raise UnknownCompressionError(f"a chunk is packed with {record.compression!r}")
    size = record.uncompressed_size
    if record.compression == "zstd":
        size = max(size, zstandard.frame_content_size(record.data))
    if size > RECORD_LIMIT:
        raise ContradictionError(f"a chunk claims {size} bytes, more than {RECORD_LIMIT}")
    if record.uncompressed_crc == 0:
        raise ContradictionError("a chunk has no checksum")
    return breakup_chunk(record, validate_crc=True)


class _Tally:
    """Counts what a file holds, to compare it with what the file says it holds."""

    def __init__(self) -> None:
        self.ended = False
        self.counts: Counter[type[McapRecord]] = Counter()
        self._by_channel: Counter[int] = Counter()
        self._ids: dict[type[McapRecord], set[int]] = {Schema: set(), Channel: set()}

    def add(self, record: McapRecord) -> None:
        """Counts a record; one of statistics is compared with what came before it."""
        if isinstance(record, Statistics):
            self._compare(record)
        elif isinstance(record, (Schema, Channel)):
            self._ids[type(record)].add(record.id)  # both are repeated at the end
        elif isinstance(record, Message):
            self._by_channel[record.channel_id] += 1
        elif isinstance(record, DataEnd):
            self.ended = True
            if record.data_section_crc == 0:
                raise ContradictionError("it has no checksum over its data")
        self.counts[type(record)] += 1

    def _compare(self, statistics: Statistics) -> None:
        pairs = {
            "messages": (statistics.message_count, self.counts[Message]),
            "messages by channel": (statistics.channel_message_counts, dict(self._by_channel)),
            "attachments": (statistics.attachment_count, self.counts[Attachment]),
            "metadata records": (statistics.metadata_count, self.counts[Metadata]),
            "chunks": (statistics.chunk_count, self.counts[Chunk]),
            "schemas": (statistics.schema_count, len(self._ids[Schema])),
            "channels": (statistics.channel_count, len(self._ids[Channel])),
        }
        for what, (expected, got) in pairs.items():
            if expected != got:
                raise ContradictionError(f"its statistics say {expected} {what}, it holds {got}")


def _check_summary(file: IO[bytes], footer: Footer) -> None:
    position = file.tell()
    end = position - 4  # the checksum covers all of the footer but itself
    start = footer.summary_start or position - _FOOTER
    if start >= end:
        raise ContradictionError("its footer points outside of the file")
    file.seek(start)
    checksum = zlib.crc32(file.read(end - start))
    file.seek(position)
    if checksum != footer.summary_crc:
        raise ContradictionError("the checksum of its summary is wrong")
