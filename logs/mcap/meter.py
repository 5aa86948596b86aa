"""Counters of the records and bytes of one trial log, with the limits of a budget."""

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Metadata, Schema

from selfmodel.sandbox.budget import Budget


class ExcessError(ValueError):
    """A file exceeds the budget."""


class Meter:
    """Counters of the records and bytes of one file, with their limits.

    Args:
        budget: Limits of the file.
    """

    def __init__(self, budget: Budget) -> None:
        self.budget = budget
        self._frames = self._records = self._unpacked = self._attached = self._other = (
            self._names
        ) = 0
        self._ids: set[tuple[type[McapRecord], int]] = set()

    def frame(self, opcode: int, size: int) -> None:
        """Counts a record outside a chunk, or one within a chunk that is not a message.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._frames += 1
        self._check(self._frames, self.budget.frames, "records and chunks")
        if opcode == Opcode.ATTACHMENT:
            self._attached += size
            self._check(self._attached, self.budget.attached_bytes, "bytes attached")
        elif opcode not in (Opcode.CHUNK, Opcode.MESSAGE):
            self._other += size
            self._check(
                self._other,
                self.budget.other_bytes,
                "bytes outside its messages and attachments",
            )

    def chunk(self, size: int) -> None:
        """Counts a chunk before it is decompressed.

        Args:
            size: Decompressed size, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._unpacked += size
        self._check(self._unpacked, self.budget.unpacked_bytes, "bytes, unpacked")

    def record(self, opcode: int, size: int) -> None:
        """Counts a record within a chunk.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._records += 1
        self._check(self._records, self.budget.records, "messages")
        if opcode != Opcode.MESSAGE:
            self.frame(opcode, size)

    def name(self, record: McapRecord) -> None:
        """Counts the names in a record: a channel or a schema once, and keys of metadata.

        Raises:
            ExcessError: The file exceeds the limit.
        """
        if isinstance(record, (Channel, Schema)):
            self._ids.add((type(record), record.id))
        elif isinstance(record, Metadata):
            self._names += 1 + len(record.metadata)
        elif isinstance(record, Attachment):
            self._names += 1
        self._check(len(self._ids) + self._names, self.budget.names, "names")

    def _check(self, count: int, limit: int, unit: str) -> None:
        if count > limit:
            raise ExcessError(
                f"it has more than the {limit} {unit} that a budget of "
                f"{self.budget.memory / 1e9:.3g} GB allows"
            )
