"""How much of the machine one file may take, however its bytes are arranged."""

from mcap.opcode import Opcode

RECORD_LIMIT = 1_000_000
"""Records that the chunks of a log may hold: six topics at 100 Hz for 27 minutes."""

FRAME_LIMIT = 200_000
"""Records that a log may hold beside those in chunks: one chunk has about ten indices."""

UNPACKED_LIMIT = 384 * 2**20
"""Bytes that the chunks of a log may have, unpacked."""

OTHER_LIMIT = 32 * 2**20
"""Bytes of all that is neither chunk, message nor attachment: in memory it takes twenty times as
much."""

ATTACHED_LIMIT = 32 * 2**20
"""Bytes that all attachments of a log may have."""


class ExcessError(ValueError):
    """A file holds more than a log may."""


class Budget:
    """Counts what one file has asked for."""

    def __init__(self) -> None:
        self._frames = self._records = self._unpacked = self._attached = self._other = 0

    def frame(self, opcode: int, size: int) -> None:
        """Counts a record that is no message in a chunk.

        Raises:
            ExcessError: It is one too many.
        """
        self._frames += 1
        if self._frames > FRAME_LIMIT:
            raise ExcessError(f"it holds more than a log may: {FRAME_LIMIT} records and chunks")
        if opcode == Opcode.ATTACHMENT:
            self._attached += size
        elif opcode not in (Opcode.CHUNK, Opcode.MESSAGE):
            self._other += size
        if self._attached > ATTACHED_LIMIT:
            raise ExcessError(f"it holds more than a log may: {ATTACHED_LIMIT} bytes attached")
        if self._other > OTHER_LIMIT:
            raise ExcessError(
                f"it holds more than a log may: {OTHER_LIMIT} bytes beside its messages and "
                f"attachments"
            )

    def chunk(self, size: int) -> None:
        """Counts a chunk before it is unpacked.

        Raises:
            ExcessError: It is one too many.
        """
        self._unpacked += size
        if self._unpacked > UNPACKED_LIMIT:
            raise ExcessError(f"it holds more than a log may: {UNPACKED_LIMIT} bytes, unpacked")

    def record(self, opcode: int, size: int) -> None:
        """Counts a record within a chunk.

        Raises:
            ExcessError: It is one too many.
        """
        self._records += 1
        if self._records > RECORD_LIMIT:
            raise ExcessError(f"it holds more than a log may: {RECORD_LIMIT} messages")
        if opcode != Opcode.MESSAGE:
            self.frame(opcode, size)
