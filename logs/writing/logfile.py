"""MCAP file under construction: a ``.part`` until it is finished, flushed on request."""

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from mcap.writer import CompressionType, Writer

from selfmodel.logs.atomic import partial_path, sync
from selfmodel.logs.files import as_write_error, create_partial, publish
from selfmodel.logs.mcap.provenance import (
    PROVENANCE,
    SEAL_TYPE,
    Batch,
    identity_of,
    manifest,
    seal_of,
    topic_key,
)
from selfmodel.logs.messages.schemas import schema_text
from selfmodel.logs.records import (
    DIGEST,
    LAST_BATCH,
    MANIFEST,
    MEDIA_TYPES,
    RESULT,
    Result,
    sha256,
    with_digest,
)
from selfmodel.version import __version__

CHUNK = 256 * 2**10
"""Size of a chunk before compression, bytes: with the library's 1 MiB, a kill would lose a whole
trial."""

_NEVER = 2**62
"""Size at which the library ends a chunk by itself, bytes: a chunk is one batch with its seal."""

Row = tuple[int, int, int, bytes]
"""Message: sequence number, index of its channel, time in ns, and payload."""


class LogFile:
    """Writer of the records of a log; the constructor creates the file.

    The order is: metadata and attachments, ``begin``, channels and messages, ``finish``.

    Args:
        path: Name of the finished file.

    Raises:
        InputError: The file exists, finished or not, or its folder does not.
        LogWriteError: This, and every method but ``close``: the disk is full, or failed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = create_partial(path)
        self._schemas: dict[str, int] = {}
        self._records: dict[str, str] = {}
        self._files: dict[str, str] = {}
        self._keys: dict[int, bytes] = {}
        self._batch: list[tuple[list[bytes], Sequence[Row]]] = []
        self._batches = 0
        self._trial, self._seals = "", -1
        self._identity = self._last = b""
        self._mcap = Writer(
            self._file,
            chunk_size=_NEVER,
            compression=CompressionType.ZSTD,
            # No other checksum covers attachments and metadata.
            enable_data_crcs=True,
        )
        with as_write_error(partial_path(path)):
            self._mcap.start(profile="ros2", library=f"selfmodel/{__version__}")

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Writes a metadata record, with its digest."""
        record = with_digest(name, texts)
        self._records[name] = record[DIGEST]
        with as_write_error(partial_path(self.path)):
            self._mcap.add_metadata(name, record)

    def attach(self, name: str, data: bytes) -> None:
        """Writes an attachment."""
        self._files[name] = sha256(data)
        media_type = MEDIA_TYPES.get(name, "application/octet-stream")
        with as_write_error(partial_path(self.path)):
            # Times of 0: the bytes do not depend on the date.
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def begin(self, trial: str) -> None:
        """Ends the preamble with its manifest.

        Args:
            trial: Name of the trial.
        """
        texts = manifest(self._records, self._files)
        self.metadata(MANIFEST, texts)
        self._trial, self._identity = trial, identity_of(texts)
        self._last = self._identity

    def channel(self, topic: str, kind: str) -> int:
        """Registers a topic of messages of one type, and returns its channel number."""
        text = schema_text(kind).encode()
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._mcap.register_schema(kind, "ros2msg", text)
            self._schemas[kind] = schema
        channel = self._mcap.register_channel(topic, "cdr", schema)
        self._keys[channel] = topic_key(topic, kind, "cdr", text)
        return channel

    def messages(self, channels: Sequence[int], rows: Sequence[Row]) -> None:
        """Writes messages; those that exceed ``CHUNK`` are flushed in parts.

        Args:
            channels: Channel numbers.
            rows: Messages.
        """
        if len(rows) > 1 and sum(len(row[3]) for row in rows) > CHUNK:
            middle = len(rows) // 2
            self.messages(channels, rows[:middle])
            self.flush()
            self.messages(channels, rows[middle:])
            return
        write = self._mcap.add_message
        with as_write_error(partial_path(self.path)):
            for sequence, index, nanoseconds, payload in rows:
                write(channels[index], nanoseconds, payload, nanoseconds, sequence)
        self._batch.append(([self._keys[channel] for channel in channels], rows))

    def flush(self) -> None:
        """Flushes to the operating system; a kill of the process then loses no data."""
        with as_write_error(partial_path(self.path)):
            if self._batch:
                self._seal()
            self._mcap.flush()

    def sync(self) -> None:
        """Flushes to the disk."""
        self.flush()
        with as_write_error(partial_path(self.path)):
            sync(self._file)

    def finish(self, result: Result) -> None:
        """Writes the result and the end of the file, and renames the ``.part``.

        Raises:
            InputError: A file of that name was created meanwhile; the ``.part`` remains.
        """
        self.flush()
        self.metadata(RESULT, {**result.texts(), LAST_BATCH: self._last.hex()})
        with as_write_error(partial_path(self.path)):
            self._mcap.finish()
            publish(self._file, self.path)

    def _seal(self) -> None:
        """Writes the seal of the messages since the last flush."""
        times = [row[2] for _, rows in self._batch for row in rows]
        batch = Batch(
            keys=[keys[row[1]] for keys, rows in self._batch for row in rows],
            log_times=times,
            publish_times=times,
            payloads=[row[3] for _, rows in self._batch for row in rows],
        )
        seal = seal_of(self._trial, self._identity, self._batches, self._last, batch)
        if self._seals < 0:
            self._seals = self.channel(PROVENANCE, SEAL_TYPE)
        time = times[-1]
        self._mcap.add_message(self._seals, time, seal.payload(time), time, seal.index)
        self._batch.clear()
        self._batches, self._last = self._batches + 1, seal.digest

    def abandon(self) -> None:
        """Closes and deletes the unfinished file."""
        self.close()
        partial_path(self.path).unlink(missing_ok=True)

    def close(self) -> None:
        """Closes the file without finishing it; no effect on a closed file."""
        with contextlib.suppress(OSError):  # an earlier error has been raised already
            self._file.close()
