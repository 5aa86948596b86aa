"""How records lie in an MCAP file, and what a record or a chunk holds; every size is bounded.

The library reads a damaged length before it looks whether so many bytes are there, and unpacks lz4
without a bound. So the bytes are cut into records here, and each is given to the library alone.
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import get_chunk_data_stream

from selfmodel.logs.budget import Budget
from selfmodel.logs.unpack import unlz4, unzstd

MAGIC = b"\x89MCAP0\r\n"

FRAME = 1 + 8
"""Bytes before a record's own: what it is, and its length."""

CHUNK_LIMIT = 16 * 2**20
"""Bytes that a chunk may unpack to: ours have 64 KiB, and the smallest messages take 30 bytes."""


class ContradictionError(ValueError):
    """Every record can be read, but two of them do not agree."""


class UncheckedError(ValueError):
    """There is no checksum, so nobody can say whether these are the bytes that were written."""


class UnknownCompressionError(ValueError):
    """A chunk is packed in a way that is not known here."""


FAILURES = (
    McapError,
    ValueError,  # a wrong checksum, text that is not UTF-8, and the three above
    RuntimeError,  # lz4
    struct.error,
    zstandard.ZstdError,
    KeyError,
    EOFError,
    MemoryError,
    OverflowError,
)
"""Everything that the library and its decompressors raise over damaged bytes."""


@dataclass(frozen=True)
class Frame:
    """One record as it lies in a file.

    Attributes:
        offset: Where it begins.
        opcode: What it is.
        body: Its bytes, after its length.
    """

    offset: int
    opcode: int
    body: bytes

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.offset + FRAME + len(self.body)


def frames(data: bytes, offset: int = len(MAGIC)) -> Iterator[Frame]:
    """Yields the records from an offset on, up to the footer.

    Raises:
        EndOfFile: The data end before the footer does.
    """
    opcode = 0
    while opcode != Opcode.FOOTER:
        if offset + FRAME > len(data):
            raise EndOfFile
        opcode, length = struct.unpack_from("<BQ", data, offset)
        start = offset + FRAME
        if length > len(data) - start:
            raise EndOfFile
        yield Frame(offset, opcode, data[start : start + length])
        offset = start + length


def parse(frame: Frame) -> McapRecord | None:
    """Returns what a record says; None for one of a kind that the format does not know yet.

    Raises:
        Exception: One of ``FAILURES``: its bytes do not fit its kind.
    """
    stream = ReadDataStream(io.BytesIO(frame.body))
    if frame.opcode == Opcode.MESSAGE:
        message: McapRecord = Message.read(stream, len(frame.body))
        return message
    if frame.opcode == Opcode.ATTACHMENT:
        checksum = int.from_bytes(frame.body[-4:], "little")
        if checksum and zlib.crc32(memoryview(frame.body)[:-4]) != checksum:
            raise ContradictionError("the checksum of an attachment is wrong")
    read = _READERS.get(frame.opcode)
    return read(stream) if read else None


def unpack(chunk: Chunk, budget: Budget) -> list[McapRecord]:
    """Returns the records in a chunk.

    Args:
        chunk: It is changed.
        budget: Counts what it holds.

    Raises:
        Exception: One of ``FAILURES``: it is damaged, unpacks to more than ``CHUNK_LIMIT`` bytes,
            or has no checksum.
    """
    if chunk.uncompressed_size > CHUNK_LIMIT:
        raise ContradictionError(
            f"a chunk claims {chunk.uncompressed_size} bytes, more than {CHUNK_LIMIT}"
        )
    if chunk.uncompressed_crc == 0 and chunk.uncompressed_size:
        raise UncheckedError("a chunk has no checksum")
    budget.chunk(chunk.uncompressed_size)
    unpack_chunk(chunk)
    get_chunk_data_stream(chunk, validate_crc=True)
    return _records(chunk.data, budget)


def _records(data: bytes, budget: Budget) -> list[McapRecord]:
    """Cuts a chunk up as the library does, but stops where there are too many records."""
    found: list[McapRecord] = []
    offset = 0
    while offset < len(data):
        opcode, length = struct.unpack_from("<BQ", data, offset)
        budget.record(opcode, length)
        start = offset + FRAME
        if length > len(data) - start:
            raise EndOfFile
        if opcode == Opcode.MESSAGE:
            found.append(_message(data[start : start + length]))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            record = parse(Frame(offset, opcode, data[start : start + length]))
            found += [] if record is None else [record]
        offset = start + length
    return found


def _message(body: bytes) -> Message:
    """Reads a message as the library does, in a third of the time."""
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
    return Message(channel, log_time, body[_MESSAGE.size :], publish_time, sequence)


_MESSAGE = struct.Struct("<HIQQ")


def unpack_chunk(chunk: Chunk) -> None:
    """Puts what a chunk holds in the place of what it was packed to.

    Raises:
        Exception: One of ``FAILURES``: it is damaged, or unpacks to another size than it claims.
    """
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        chunk.data = unzstd(chunk.data, size)
    elif chunk.compression == "lz4":
        chunk.data = unlz4(chunk.data, size)
    elif chunk.compression:
        raise UnknownCompressionError(
            f"a chunk is packed with {chunk.compression!r}; zstd and lz4 are known"
        )
    chunk.compression = ""
    if len(chunk.data) != size:
        raise ContradictionError(f"a chunk claims {size} bytes, and has {len(chunk.data)}")


_READERS: Mapping[int, Callable[[ReadDataStream], McapRecord]] = MappingProxyType(
    {
        Opcode.ATTACHMENT: Attachment.read,
        Opcode.ATTACHMENT_INDEX: AttachmentIndex.read,
        Opcode.CHANNEL: Channel.read,
        Opcode.CHUNK: Chunk.read,
        Opcode.CHUNK_INDEX: ChunkIndex.read,
        Opcode.DATA_END: DataEnd.read,
        Opcode.FOOTER: Footer.read,
        Opcode.HEADER: Header.read,
        Opcode.MESSAGE_INDEX: MessageIndex.read,
        Opcode.METADATA: Metadata.read,
        Opcode.METADATA_INDEX: MetadataIndex.read,
        Opcode.SCHEMA: Schema.read,
        Opcode.STATISTICS: Statistics.read,
        Opcode.SUMMARY_OFFSET: SummaryOffset.read,
    }
)
