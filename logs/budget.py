"""Limits on the memory and time that reading one file may take."""

from mcap.opcode import Opcode

RECORD_LIMIT = 1_000_000
"""Maximum records in the chunks of a log: six topics at 100 Hz for 27 minutes."""

FRAME_LIMIT = 200_000
"""Maximum records of a log outside its chunks: a chunk has about ten indices."""

UNPACKED_LIMIT = 384 * 2**20
"""Maximum decompressed size of all chunks of a log, bytes."""

OTHER_LIMIT = 32 * 2**20
"""Maximum size of all records but chunks, messages and attachments, bytes: these records take
twenty times their size in memory."""

ATTACHED_LIMIT = 32 * 2**20
"""Maximum size of all attachments of a log, bytes."""


class ExcessError(ValueError):
    """A file exceeds a limit on the size of a log."""


class Budget:
    """Counters of the records and bytes of one file, with their limits."""

    def __init__(self) -> None:
        self._frames = self._records = self._unpacked = self._attached = self._other = 0

    def frame(self, opcode: int, size: int) -> None:
        """Counts a record outside a chunk, or one within a chunk that is not a message.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._frames += 1
        _check(self._frames, FRAME_LIMIT, "records and chunks")
        if opcode == Opcode.ATTACHMENT:
            self._attached += size
            _check(self._attached, ATTACHED_LIMIT, "bytes attached")
        elif opcode not in (Opcode.CHUNK, Opcode.MESSAGE):
            self._other += size
            _check(self._other, OTHER_LIMIT, "bytes outside its messages and attachments")

    def chunk(self, size: int) -> None:
        """Counts a chunk before it is decompressed.

        Args:
            size: Decompressed size, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._unpacked += size
        _check(self._unpacked, UNPACKED_LIMIT, "bytes, unpacked")

    def record(self, opcode: int, size: int) -> None:
        """Counts a record within a chunk.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._records += 1
        _check(self._records, RECORD_LIMIT, "messages")
        if opcode != Opcode.MESSAGE:
            self.frame(opcode, size)


def _check(count: int, limit: int, unit: str) -> None:
    if count > limit:
        raise ExcessError(f"it holds more than a log may: {limit} {unit}")
