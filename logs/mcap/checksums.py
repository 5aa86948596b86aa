"""Verification of all checksums and counts of an MCAP file, in one pass.

With its default settings, the mcap library's own reader misses three of four flipped bits.
"""

import zlib
from collections import Counter
from collections.abc import Iterator

from mcap.exceptions import EndOfFile, InvalidMagic
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

from selfmodel.logs.mcap.framing import (
    MAGIC,
    ContradictionError,
    Frame,
    UncheckedError,
    frames,
    parse,
    unpack,
)


def verified_records(data: bytes) -> Iterator[McapRecord]:
    """Yields the records of a file, including those within chunks, with all checksums verified.

    The file is intact if the iteration ends without an exception.

    Args:
        data: Bytes of the file.

    Raises:
        Exception: One of ``selfmodel.logs.mcap.framing.FAILURES``: the file is damaged.
    """
    _check_start(data)
    counts = _Counts()
    end = len(MAGIC)
    for frame in frames(data):
        outer = parse(frame)
        if isinstance(outer, DataEnd):
            _check_data(data, frame, outer)
        elif isinstance(outer, Footer):
            _check_summary(data, frame, outer)
        for record in _opened(outer):
            counts.add(record)
            yield record
        end = frame.end
    if not counts.by_type[DataEnd]:
        raise ContradictionError("the end of its data is not marked")
    _check_end(data, end)


def _check_start(data: bytes) -> None:
    if len(data) < len(MAGIC):
        raise EndOfFile
    if not data.startswith(MAGIC):
        raise InvalidMagic(data[: len(MAGIC)])


def _check_end(data: bytes, end: int) -> None:
    if len(data) < end + len(MAGIC):
        raise EndOfFile
    if data[end : end + len(MAGIC)] != MAGIC:
        raise ContradictionError("its last bytes are damaged")
    if len(data) > end + len(MAGIC):
        raise ContradictionError("bytes follow its end")


def _opened(record: McapRecord | None) -> list[McapRecord]:
    """Records of a chunk, then the record itself."""
    if record is None:
        return []
    return [*unpack(record), record] if isinstance(record, Chunk) else [record]


def _check_data(data: bytes, frame: Frame, end: DataEnd) -> None:
    if end.data_section_crc == 0:
        raise UncheckedError("it has no checksum over its data")
    if zlib.crc32(memoryview(data)[: frame.offset]) != end.data_section_crc:
        raise ContradictionError("the checksum over its data is wrong")


def _check_summary(data: bytes, frame: Frame, footer: Footer) -> None:
    start = footer.summary_start or frame.offset
    if start > frame.offset:
        raise ContradictionError("its footer points outside of the file")
    # The checksum covers the footer except its own bytes.
    if zlib.crc32(memoryview(data)[start : frame.end - 4]) != footer.summary_crc:
        raise ContradictionError("the checksum of its summary is wrong")


class _Counts:
    """Numbers of records by type, for comparison with the statistics in the file."""

    def __init__(self) -> None:
        self.by_type: Counter[type[McapRecord]] = Counter()
        self._by_channel: Counter[int] = Counter()
        self._ids: dict[type[McapRecord], set[int]] = {Schema: set(), Channel: set()}

    def add(self, record: McapRecord) -> None:
        """Counts a record; statistics are compared with the records before them."""
        if isinstance(record, Statistics):
            self._compare(record)
        elif isinstance(record, (Schema, Channel)):
            self._ids[type(record)].add(record.id)  # both are repeated at the end
        elif isinstance(record, Message):
            self._by_channel[record.channel_id] += 1
        self.by_type[type(record)] += 1

    def _compare(self, statistics: Statistics) -> None:
        pairs = {
            "messages": (statistics.message_count, self.by_type[Message]),
            "messages by channel": (statistics.channel_message_counts, dict(self._by_channel)),
            "attachments": (statistics.attachment_count, self.by_type[Attachment]),
            "metadata records": (statistics.metadata_count, self.by_type[Metadata]),
            "chunks": (statistics.chunk_count, self.by_type[Chunk]),
            "schemas": (statistics.schema_count, len(self._ids[Schema])),
            "channels": (statistics.channel_count, len(self._ids[Channel])),
        }
        for what, (expected, got) in pairs.items():
            if expected != got:
                raise ContradictionError(
                    f"its statistics have {expected} {what}, its records {got}"
                )
