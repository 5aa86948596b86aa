"""MCAP file under construction: a ``.part`` until it is finished, flushed on request."""

import contextlib
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from selfmodel.logs.atomic import partial_path, sync
from selfmodel.logs.files import as_write_error, create_partial, publish
from selfmodel.logs.records import MEDIA_TYPES, with_digest
from selfmodel.logs.schemas import schema_text
from selfmodel.version import __version__

CHUNK = 256 * 2**10
"""Size of a chunk before compression, bytes: with the library's 1 MiB, a kill would lose a whole
trial."""


class LogFile:
    """Writer of the records of a log; the constructor creates the file.

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
        self._mcap = Writer(
            self._file,
            chunk_size=CHUNK,
            compression=CompressionType.ZSTD,
            # No other checksum covers attachments and metadata.
            enable_data_crcs=True,
        )
        with as_write_error(partial_path(path)):
            self._mcap.start(profile="ros2", library=f"selfmodel/{__version__}")

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Writes a metadata record, with its digest."""
        with as_write_error(partial_path(self.path)):
            self._mcap.add_metadata(name, with_digest(name, texts))

    def attach(self, name: str, data: bytes) -> None:
        """Writes an attachment."""
        media_type = MEDIA_TYPES.get(name, "application/octet-stream")
        with as_write_error(partial_path(self.path)):
            # Times of 0: the bytes do not depend on the date.
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def channel(self, topic: str, kind: str) -> int:
        """Registers a topic of messages of one type, and returns its channel number."""
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._mcap.register_schema(kind, "ros2msg", schema_text(kind).encode())
            self._schemas[kind] = schema
        return self._mcap.register_channel(topic, "cdr", schema)

    def message(self, channel: int, nanoseconds: int, payload: bytes, sequence: int) -> None:
        """Writes a message; wrap calls in ``as_write_error``: a full chunk is written to disk."""
        self._mcap.add_message(channel, nanoseconds, payload, nanoseconds, sequence)

    def flush(self) -> None:
        """Flushes to the operating system; a kill of the process then loses no data."""
        with as_write_error(partial_path(self.path)):
            self._mcap.flush()

    def sync(self) -> None:
        """Flushes to the disk."""
        self.flush()
        with as_write_error(partial_path(self.path)):
            sync(self._file)

    def finish(self) -> None:
        """Writes the end of the file, and renames the ``.part``.

        Raises:
            InputError: A file of that name was created meanwhile; the ``.part`` remains.
        """
        with as_write_error(partial_path(self.path)):
            self._mcap.finish()
            publish(self._file, self.path)

    def abandon(self) -> None:
        """Closes and deletes the unfinished file."""
        self.close()
        partial_path(self.path).unlink(missing_ok=True)

    def close(self) -> None:
        """Closes the file without finishing it; no effect on a closed file."""
        with contextlib.suppress(OSError):  # an earlier error has been raised already
            self._file.close()
