"""MCAP file of a log: a writer that survives a kill, and a strict reader.

The reader makes one pass with mcap's ``StreamReader`` and its checksums of chunks and of the data,
and adds what that leaves out: the checksums of the summary and of attachments, the counts of the
statistics, and the digests of selfmodel's records. All 2,000 of 2,000 random bit flips and cuts are
noticed.
"""

import io
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec
import zstandard
from mcap import exceptions, records as mcap
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from selfmodel.errors import InputError
from selfmodel.files import read_file, sync
from selfmodel.logs import errors, records
from selfmodel.logs.errors import LogError
from selfmodel.logs.files import no_folder, partial_path, publish, refuse_existing, taken
from selfmodel.logs.messages import CHANNELS, schema_text
from selfmodel.version import __version__

CHUNK = 256 * 2**10
"""Size of a chunk before compression, bytes: with the library's 1 MiB, a kill would lose a whole
trial."""

Row = tuple[int, int, int, bytes]
"""Message: sequence number, index of its channel, time in ns, and payload."""


class LogFile:
    """Writer of the records of a log, whose name ends in ``.part`` until ``finish``.

    The order is: metadata and attachments, channels and messages, ``finish``.

    Raises:
        InputError: The file exists, finished or not, or its folder does not.
        LogWriteError: This, and every method but ``close``: the disk is full, or failed.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.part = path, partial_path(path)
        refuse_existing(path)
        with self._writing():
            try:
                self._file = self.part.open("xb")  # it follows no link
            except FileExistsError:
                raise taken(self.part) from None
            except (FileNotFoundError, NotADirectoryError):
                raise no_folder(path) from None
        self._schemas: dict[str, int] = {}
        # No other checksum than that of the data covers attachments and metadata.
        self._mcap = Writer(
            self._file, CHUNK, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        with self._writing():
            self._mcap.start(profile="ros2", library=f"selfmodel/{__version__}")

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Writes a metadata record, with its digest."""
        with self._writing():
            self._mcap.add_metadata(name, records.with_digest(name, texts))

    def attach(self, name: str, data: bytes) -> None:
        """Writes an attachment."""
        media_type = records.MEDIA_TYPES.get(name, "application/octet-stream")
        with self._writing():
            # Times of 0: the bytes do not depend on the date.
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def channel(self, topic: str, kind: str) -> int:
        """Registers a topic of messages of one type, and returns its channel number."""
        if kind not in self._schemas:
            text = schema_text(kind).encode()
            self._schemas[kind] = self._mcap.register_schema(kind, "ros2msg", text)
        metadata = dict(CHANNELS.get(topic, {}))
        return self._mcap.register_channel(topic, "cdr", self._schemas[kind], metadata)

    def messages(self, channels: Sequence[int], rows: Sequence[Row]) -> None:
        """Writes messages on some channels."""
        write = self._mcap.add_message
        with self._writing():
            for sequence, index, nanoseconds, payload in rows:
                write(channels[index], nanoseconds, payload, nanoseconds, sequence)

    def flush(self) -> None:
        """Flushes to the operating system; a kill of the process then loses no data."""
        with self._writing():
            self._mcap.flush()

    def sync(self) -> None:
        """Flushes to the disk."""
        self.flush()
        with self._writing():
            sync(self._file)

    def finish(self, result: records.ResultRecord | None = None) -> None:
        """Writes the result of a trial and the end of the file, and renames the ``.part``."""
        self.flush()
        if result is not None:
            self.metadata(records.RESULT, records.texts_of(result))
        with self._writing():
            self._mcap.finish()
            sync(self._file)
            self._file.close()
            publish(self.part, self.path)

    def abandon(self) -> None:
        """Closes and deletes the unfinished file."""
        self.close()
        self.part.unlink(missing_ok=True)

    def close(self) -> None:
        """Closes the file without finishing it; no effect on a closed file."""
        with suppress(OSError):  # an earlier error has been raised already
            self._file.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise errors.LogWriteError(self.part, error) from error


# ---------------------------------------------------------------- reading

MAGIC = b"\x89MCAP0\r\n"

MAX_BYTES = 2**31
"""Largest size of a log, bytes; a quadruped's trial of 10 s takes 0.5 MB."""

FAILURES = (
    exceptions.McapError,
    ValueError,  # a wrong checksum or digest, and text that is not UTF-8
    RuntimeError,  # lz4
    struct.error,
    zstandard.ZstdError,
    KeyError,  # a channel or a schema that is not defined
    MemoryError,
    OverflowError,
)
"""Exceptions of the strict pass for damaged bytes."""


class UncheckedError(ValueError):
    """A checksum is missing, so damage could not be detected."""


@dataclass
class Messages:
    """Messages of one channel, in the order of the file.

    Attributes:
        type: Name of the schema, or "".
        schema: Text of the schema.
        encoding: Encoding of the messages, such as ``cdr``.
        payloads: Bytes of the messages.
        times: Log time and publish time of each message, ns.
    """

    type: str
    schema: bytes
    encoding: str
    payloads: list[bytes] = field(default_factory=list)
    times: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class Contents:
    """Records of a file: metadata and attachments by name, messages by topic.

    Records of selfmodel are without their verified digest. Seals, of logs that version 0.1 wrote,
    are left out.
    """

    path: Path
    metadata: dict[str, Mapping[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    topics: dict[str, Messages] = field(default_factory=dict)

    def error(
        self,
        what: str,
        kind: type[LogError] = errors.SchemaMismatchError,
        advice: str = errors.AGAIN,
    ) -> LogError:
        """Returns an error of the file, which says how much of it is complete."""
        counts = [len(messages.payloads) for messages in self.topics.values()]
        good = f"{sum(counts)} messages on {len(counts)} topics before that are complete"
        return kind(self.path, what, good=good, advice=advice)

    @contextmanager
    def mismatch(self, what: str) -> Iterator[None]:
        """Makes an error of a parser one of the file, which begins with ``what``."""
        try:
            yield
        except (ValueError, TypeError, RecursionError, msgspec.ValidationError) as error:
            raise self.error(f"{what}: {error}") from error


def read_contents(path: Path, unread: Collection[str] = ()) -> Contents:
    """Returns the contents of a file, all verified, without the unread metadata records."""
    contents, error = read_undamaged(path, unread)
    if error is not None:
        raise error
    return contents


def read_undamaged(path: Path, unread: Collection[str] = ()) -> tuple[Contents, LogError | None]:
    """Returns the contents of a file before its first damage, and the error of that damage."""
    if path.is_dir():
        is_bag = (path / "metadata.yaml").exists() or any(path.glob("*.db3*"))
        what = "the folder of a bag of ROS 2" if is_bag else "a folder"
        raise InputError(f"{path}: expected a log file, got {what}: {errors.ANOTHER}")
    data, contents = read_file(path, "a log file", MAX_BYTES), Contents(path)
    try:
        gatherer = Gatherer(contents, unread)
        for record in verified_records(data):
            gatherer.add(record)
    except FAILURES as failure:
        return contents, _explained(data, failure, contents)
    return contents, None


def verified_records(data: bytes) -> Iterator[mcap.McapRecord]:
    """Yields the records of a file, each after the checks of what is before it.

    The file is intact if the iteration ends without an exception.
    """
    stream, counts = io.BytesIO(data), Counter[type[mcap.McapRecord]]()
    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=len(data))
    for record in reader.records:
        counts[type(record)] += 1
        if isinstance(record, mcap.Chunk):
            if record.uncompressed_size and not record.uncompressed_crc:
                raise UncheckedError("a chunk has no checksum")
            for part in breakup_chunk(record, validate_crc=True):
                counts[type(part)] += 1
                yield part
        else:
            _check(record, data, stream.tell(), counts)
            yield record
    if not counts[mcap.DataEnd]:
        raise ValueError("the end of its data is not marked")
    if rest := stream.read(len(MAGIC)):
        raise exceptions.InvalidMagic(rest)


def _check(
    record: mcap.McapRecord, data: bytes, end: int, counts: Mapping[type[mcap.McapRecord], int]
) -> None:
    """Checks what mcap does not, of a record that ends at an offset of the file."""
    match record:
        case mcap.Attachment(name=name):
            texts = len(name.encode()) + len(record.media_type.encode())
            size = 8 + 8 + 4 + 4 + texts + 8 + len(record.data) + 4
            _check_sum(data, end - size, end, f"attachment {name!r}")
        case mcap.DataEnd(data_section_crc=0):
            raise UncheckedError("it has no checksum over its data")
        case mcap.Statistics():
            for claimed, kind in (
                (record.message_count, mcap.Message),
                (record.chunk_count, mcap.Chunk),
                (record.attachment_count, mcap.Attachment),
                (record.metadata_count, mcap.Metadata),
            ):
                if claimed != counts[kind]:
                    counted = f"{claimed} of {kind.__name__}, its records {counts[kind]}"
                    raise ValueError(f"its statistics have {counted}")
        case mcap.Footer():
            # The checksum covers the footer except its own bytes.
            start = record.summary_start or end - (1 + 8 + 8 + 8 + 4)
            _check_sum(data, start, end, "summary")


def _check_sum(data: bytes, start: int, end: int, what: str) -> None:
    stored = int.from_bytes(data[end - 4 : end], "little")
    if zlib.crc32(memoryview(data)[start : end - 4]) != stored:
        raise ValueError(f"the checksum of its {what} is wrong")


class Gatherer:
    """Adds the records of a file, one after the other, to its contents."""

    def __init__(self, contents: Contents, unread: Collection[str] = ()) -> None:
        self.contents, self._unread = contents, unread
        self._schemas: dict[int, mcap.Schema] = {0: mcap.Schema(0, b"", "", "")}
        self._channels: dict[int, Messages] = {}

    def add(self, record: mcap.McapRecord) -> None:
        """Adds a record."""
        contents = self.contents
        match record:
            case mcap.Message():
                messages = self._channels[record.channel_id]
                messages.payloads.append(record.data)
                messages.times.append((record.log_time, record.publish_time))
            case mcap.Schema():
                self._schemas[record.id] = record
            case mcap.Channel() if record.id not in self._channels:  # repeated at the end
                schema = self._schemas[record.schema_id]
                messages = Messages(schema.name, schema.data, record.message_encoding)
                self._channels[record.id] = messages
                if (record.topic, schema.name) != (records.SEALS, records.SEAL_TYPE):
                    _add_once(contents.topics, record.topic, messages)
            case mcap.Metadata() if record.name not in self._unread:
                texts = record.metadata
                if record.name.startswith(records.OWN):
                    texts = records.without_digest(record.name, texts)
                _add_once(contents.metadata, record.name, texts)
            case mcap.Attachment():
                _add_once(contents.attachments, record.name, record.data)


_Item = TypeVar("_Item")


def _add_once(items: dict[str, _Item], name: str, item: _Item) -> None:
    if name in items:
        raise ValueError(f"it has {name!r} twice")
    items[name] = item


def _explained(data: bytes, failure: Exception, contents: Contents) -> LogError:
    path, salvage_it = contents.path, errors.salvage_it(contents.path)
    if len(data) <= len(MAGIC):
        return errors.NotMcapError(path, "the file is empty or too short", advice=errors.ANOTHER)
    if not data.startswith(MAGIC):
        return errors.NotMcapError(path, "this is not an MCAP file", advice=errors.ANOTHER)
    if isinstance(failure, UncheckedError):
        what = f"{failure}: selfmodel did not write this file"
        return contents.error(what, errors.UnsupportedError, errors.IMPORT_IT)
    if isinstance(failure, exceptions.InvalidMagic):
        return contents.error("its last bytes are damaged", errors.CorruptError, salvage_it)
    if not data.endswith(MAGIC):
        return contents.error("the file ends too early", errors.TruncatedError, salvage_it)
    what = f"the file is damaged: {failure or type(failure).__name__}"
    return contents.error(what, errors.CorruptError, salvage_it)
