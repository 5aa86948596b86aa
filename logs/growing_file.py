"""An MCAP file that is read while it is written: each record once, as soon as it is complete."""

import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from mcap import exceptions, records as mcap
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, breakup_chunk

from selfmodel.errors import InputError
from selfmodel.logs.log_file import MAGIC

_HEAD = 9
"""Bytes of a record before its content: its kind, and the length of the content."""

_KINDS = frozenset(map(int, Opcode))
"""Kinds of records; a recorder may have others of its own."""


class GrowingFile:
    """An MCAP file that may be unfinished; it ``has_ended`` once the end of its data was read."""

    def __init__(self, path: Path) -> None:
        self.path, self.has_ended = path, False
        self._file = path.open("rb")

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def parts(self) -> Iterator[Sequence[mcap.McapRecord]]:
        """Yields what was completed since the last call: the records of a chunk, or one record.

        Raises:
            InputError: The file is another one than before.
            InvalidMagic: It is no MCAP file.
            Exception: It is damaged; see ``log_file.FAILURES``.
        """
        while not self.has_ended:
            begin, size = self._file.tell(), os.fstat(self._file.fileno()).st_size
            if size < begin:
                raise InputError(
                    f"{self.path}: it is shorter than what was read of it, so its recorder began "
                    f"it anew: start the watch again"
                )
            if not begin and not MAGIC.startswith(magic := self._file.read(len(MAGIC))):
                raise exceptions.InvalidMagic(magic)
            head = self._file.read(_HEAD)
            end = self._file.tell() + int.from_bytes(head[1:], "little")
            if len(head) < _HEAD or end > size:
                self._file.seek(begin)
                self._check_not_replaced()
                return
            data = head + self._file.read(end - self._file.tell())
            if head[0] not in _KINDS:
                continue
            record = next(StreamReader(io.BytesIO(data), skip_magic=True, emit_chunks=True).records)
            self.has_ended = isinstance(record, mcap.DataEnd)
            if isinstance(record, mcap.Chunk):
                yield breakup_chunk(record, validate_crc=True)
            else:
                yield [record]

    def _check_not_replaced(self) -> None:
        """Checks that no other file has the name of one that is read no further.

        A file that was moved, as a log is when it is finished, leaves its name free.
        """
        try:
            is_same = os.path.samestat(self.path.stat(), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            return
        if not is_same:
            raise InputError(
                f"{self.path}: it is another file than before, so its recorder began anew under "
                f"the same name: start the watch again"
            )
