"""Bounded parsing of MCAP: a file into records, a record's fields, a chunk's records.

The mcap library trusts a damaged length, and decompresses lz4 without a limit. The bytes are
therefore split into records here, and each record is parsed by the library alone.
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import lz4.frame
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
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import get_chunk_data_stream

MAGIC = b"\x89MCAP0\r\n"

MAX_CHUNK = 2**28
"""Largest decompressed size of a chunk, bytes; those written have 256 KiB."""

FRAME = 1 + 8
"""Size of the opcode and the length before a record's content, bytes."""


class ContradictionError(ValueError):
    """Every record can be parsed, but two records contradict each other."""


class UncheckedError(ValueError):
    """A checksum is missing, so damage could not be detected."""


class UnknownCompressionError(ValueError):
    """A chunk has an unknown compression."""


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
"""Exceptions that the mcap library and its decompressors raise for damaged bytes."""


@dataclass(frozen=True)
class Frame:
    """Undecoded record of a file.

    Attributes:
        offset: Offset of the record in the file, bytes.
        opcode: Type of the record.
        body: Content of the record, without opcode and length.
    """

    offset: int
    opcode: int
    body: bytes

    @property
    def end(self) -> int:
        """Offset of the next record, bytes."""
        return self.offset + FRAME + len(self.body)


def frames(data: bytes, offset: int = len(MAGIC)) -> Iterator[Frame]:
    """Yields the records from an offset on, up to the footer.

    Raises:
        EndOfFile: The data end before the end of the footer.
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
    """Returns the decoded record; None for an index of messages, or an undefined type.

    Raises:
        Exception: One of ``FAILURES``: the content is invalid for the type.
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


def unpack(chunk: Chunk) -> list[McapRecord]:
    """Returns the records in a chunk.

    Args:
        chunk: Chunk, which is decompressed in place.

    Raises:
        Exception: One of ``FAILURES``: the chunk is damaged, or has no checksum.
    """
    if chunk.uncompressed_size > MAX_CHUNK:
        raise ContradictionError(
            f"a chunk claims {chunk.uncompressed_size} bytes, more than {MAX_CHUNK}"
        )
    if chunk.uncompressed_crc == 0 and chunk.uncompressed_size:
        raise UncheckedError("a chunk has no checksum")
    unpack_chunk(chunk)
    get_chunk_data_stream(chunk, validate_crc=True)
    return _records(chunk.data)


def _records(data: bytes) -> list[McapRecord]:
    """Splits a chunk as the library does."""
    found: list[McapRecord] = []
    offset = 0
    while offset < len(data):
        opcode, length = struct.unpack_from("<BQ", data, offset)
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
    """Parses a message as the library does, in a third of the time."""
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
    return Message(channel, log_time, body[_MESSAGE.size :], publish_time, sequence)


_MESSAGE = struct.Struct("<HIQQ")


def unpack_chunk(chunk: Chunk) -> None:
    """Decompresses a chunk in place.

    Raises:
        Exception: One of ``FAILURES``: the chunk is damaged, or its decompressed size is not the
            size that it claims.
    """
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        # Not decompress(), which allocates the size that the frame claims.
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            chunk.data = reader.read(size + 1)
    elif chunk.compression == "lz4":
        unlz4 = lz4.frame.LZ4FrameDecompressor()
        chunk.data = unlz4.decompress(chunk.data, max_length=size + 1)
    elif chunk.compression:
        raise UnknownCompressionError(
            f"a chunk is packed with {chunk.compression!r}; zstd and lz4 are known"
        )
    chunk.compression = ""
    if len(chunk.data) > size:
        raise ContradictionError(f"a chunk unpacks to more than {size} bytes, which it claims")
    if len(chunk.data) < size:
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
        Opcode.METADATA: Metadata.read,
        Opcode.METADATA_INDEX: MetadataIndex.read,
        Opcode.SCHEMA: Schema.read,
        Opcode.STATISTICS: Statistics.read,
        Opcode.SUMMARY_OFFSET: SummaryOffset.read,
    }
)
