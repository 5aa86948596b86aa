"""MCAP file under construction: a ``.part`` until it is finished, flushed on request."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from mcap.writer import CompressionType, Writer

from selfmodel.errors import InputError
from selfmodel.files import sync
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import partial_path, publish, refuse_existing
from selfmodel.logs.records import MEDIA_TYPES, RESULT, Result, with_digest
from selfmodel.logs.topics import schema_text
from selfmodel.version import __version__

CHUNK = 256 * 2**10
"""Size of a chunk before compression, bytes: with the library's 1 MiB, a kill would lose a whole
trial."""

Row = tuple[int, int, int, bytes]
"""Message: sequence number, index of its channel, time in ns, and payload."""


class LogFile:
    """Writer of the records of a log; the constructor creates the file.

    The order is: metadata and attachments, channels and messages, ``finish``.

    Args:
        path: Name of the finished file.

    Raises:
        InputError: The file exists, finished or not, or its folder does not.
        LogWriteError: This, and every method but ``close``: the disk is full, or failed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.part = partial_path(path)
        refuse_existing(path)
        with self._writing():
            try:
                self._file = self.part.open("xb")  # it follows no link
            except FileExistsError:
                raise InputError(
                    f"{self.part} exists, and is not overwritten: choose another name"
                ) from None
            except (FileNotFoundError, NotADirectoryError):
                raise InputError(
                    f"{path}: there is no folder {path.parent}: make it, or choose another"
                ) from None
        self._schemas: dict[str, int] = {}
        self._mcap = Writer(
            self._file,
            chunk_size=CHUNK,
            compression=CompressionType.ZSTD,
            # No other checksum covers attachments and metadata.
            enable_data_crcs=True,
        )
        with self._writing():
            self._mcap.start(profile="ros2", library=f"selfmodel/{__version__}")

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Writes a metadata record, with its digest."""
        with self._writing():
            self._mcap.add_metadata(name, with_digest(name, texts))

    def attach(self, name: str, data: bytes) -> None:
        """Writes an attachment."""
        media_type = MEDIA_TYPES.get(name, "application/octet-stream")
        with self._writing():
            # Times of 0: the bytes do not depend on the date.
            self._mcap.add_attachment(0, 0, name, media_type, data)

    def channel(self, topic: str, kind: str) -> int:
        """Registers a topic of messages of one type, and returns its channel number."""
        if kind not in self._schemas:
            text = schema_text(kind).encode()
            self._schemas[kind] = self._mcap.register_schema(kind, "ros2msg", text)
        return self._mcap.register_channel(topic, "cdr", self._schemas[kind])

    def messages(self, channels: Sequence[int], rows: Sequence[Row]) -> None:
        """Writes messages.

        Args:
            channels: Channel numbers.
            rows: Messages.
        """
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

    def finish(self, result: Result) -> None:
        """Writes the result and the end of the file, and renames the ``.part``.

        Raises:
            InputError: A file of that name was created meanwhile; the ``.part`` remains.
        """
        self.flush()
        self.metadata(RESULT, result.texts())
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
        with contextlib.suppress(OSError):  # an earlier error has been raised already
            self._file.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise LogWriteError(self.part, error) from error
