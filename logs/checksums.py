"""One strict pass over an MCAP file that lets no damaged byte through.

The library's own reader checks too little by default: of flipped bits, three in four pass. Here
every checksum that the format has is compared, and the counts too.
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

from selfmodel.logs.budget import Budget
from selfmodel.logs.framing import (
    MAGIC,
    ContradictionError,
    Frame,
    UncheckedError,
    frames,
    parse,
    unpack,
)


def verified_records(data: bytes) -> Iterator[McapRecord]:
    """Yields each record of a file, the ones within chunks in their place, checking all.

    A caller knows that the file is sound when the iteration ends without an exception.

    Args:
        data: All of the file.

    Raises:
        Exception: One of ``selfmodel.logs.framing.FAILURES``: damage, as the library meets it.
    """
    _check_start(data)
    tally, budget = _Tally(), Budget()
    end = len(MAGIC)
    for frame in frames(data):
        budget.frame(frame.opcode, len(frame.body))
        outer = parse(frame)
        if isinstance(outer, DataEnd):
            _check_data(data, frame, outer)
        elif isinstance(outer, Footer):
            _check_summary(data, frame, outer)
        for record in _opened(outer, budget):
            tally.add(record)
            yield record
        end = frame.end
    if not tally.counts[DataEnd]:
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
        raise ContradictionError("something follows its end")


def _opened(record: McapRecord | None, budget: Budget) -> list[McapRecord]:
    """The record and, for a chunk, what is in it."""
    if record is None:
        return []
    return [*unpack(record, budget), record] if isinstance(record, Chunk) else [record]


def _check_data(data: bytes, frame: Frame, end: DataEnd) -> None:
    if end.data_section_crc == 0:
        raise UncheckedError("it has no checksum over its data")
    if zlib.crc32(memoryview(data)[: frame.offset]) != end.data_section_crc:
        raise ContradictionError("the checksum over its data is wrong")


def _check_summary(data: bytes, frame: Frame, footer: Footer) -> None:
    start = footer.summary_start or frame.offset
    if start > frame.offset:
        raise ContradictionError("its footer points outside of the file")
    # The checksum covers all of the footer but itself.
    if zlib.crc32(memoryview(data)[start : frame.end - 4]) != footer.summary_crc:
        raise ContradictionError("the checksum of its summary is wrong")


class _Tally:
    """Counts what a file holds, to compare it with what the file says it holds."""

    def __init__(self) -> None:
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
