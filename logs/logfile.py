"""An MCAP file that is being written: a ``.part`` until it is finished, flushed as told."""

import contextlib
from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

import selfmodel
from selfmodel.logs.atomic import partial_path, sync
from selfmodel.logs.files import as_write_error, create_partial, publish
from selfmodel.logs.records import MEDIA_TYPES, with_digest
from selfmodel.logs.schemas import schema_text

CHUNK = 256 * 2**10
"""Bytes that are packed together: with the library's 1 MiB a kill would lose a whole trial."""


class LogFile:
    """Writes the records of a log.

    Making one makes the file, so ``TrialWriter`` does it only as it is entered.

    Args:
        path: What the file is to be called once it is finished.

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
            # Without it nothing protects attachments and metadata.
            enable_data_crcs=True,
        )
        with as_write_error(partial_path(path)):
            self._mcap.start(profile="ros2", library=f"selfmodel/{selfmodel.__version__}")

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Writes a record of names and texts, with its digest."""
        with as_write_error(partial_path(self.path)):
            self._mcap.add_metadata(name, with_digest(name, texts))

    def attach(self, name: str, data: bytes) -> None:
        """Writes a file within the file."""
        media_type = MEDIA_TYPES.get(name, "application/octet-stream")
        with as_write_error(partial_path(self.path)):
            # Times of 0: the same trial gives the same bytes, whenever it is run.
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def channel(self, topic: str, kind: str) -> int:
        """Announces a topic of messages of one type, and returns its number."""
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._mcap.register_schema(kind, "ros2msg", schema_text(kind).encode())
            self._schemas[kind] = schema
        return self._mcap.register_channel(topic, "cdr", schema)

    def message(self, channel: int, nanoseconds: int, payload: bytes, sequence: int) -> None:
        """Writes a message; wrap calls in ``as_write_error``: a full chunk is written to disk."""
        self._mcap.add_message(channel, nanoseconds, payload, nanoseconds, sequence)

    def flush(self) -> None:
        """Hands everything to the operating system, where a kill cannot reach it."""
        with as_write_error(partial_path(self.path)):
            self._mcap.flush()

    def sync(self) -> None:
        """Waits until the disk has everything."""
        self.flush()
        with as_write_error(partial_path(self.path)):
            sync(self._file)

    def finish(self) -> None:
        """Writes what ends a file, and gives the file its name.

        Raises:
            InputError: A file of that name has come to exist meanwhile; the part stays.
        """
        with as_write_error(partial_path(self.path)):
            self._mcap.finish()
            publish(self._file, self.path)

    def abandon(self) -> None:
        """Closes the file and takes it away: what it holds is also elsewhere."""
        self.close()
        partial_path(self.path).unlink(missing_ok=True)

    def close(self) -> None:
        """Closes the file as it is; harmless when it is closed."""
        with contextlib.suppress(OSError):  # what led here has been raised already
            self._file.close()
