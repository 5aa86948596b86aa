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
        self._counts: dict[str, int] = {}
        self._ids: set[tuple[type[McapRecord], int]] = set()

    def frame(self, opcode: int, size: int) -> None:
        """Counts a record outside a chunk, or one within a chunk that is not a message.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._add("records and chunks", 1, self.budget.frames)
        if opcode == Opcode.ATTACHMENT:
            self._add("bytes attached", size, self.budget.attached_bytes)
        elif opcode not in (Opcode.CHUNK, Opcode.MESSAGE):
            self._add("bytes outside its messages and attachments", size, self.budget.other_bytes)

    def chunk(self, size: int) -> None:
        """Counts a chunk before it is decompressed.

        Args:
            size: Decompressed size, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._add("bytes, unpacked", size, self.budget.unpacked_bytes)

    def record(self, opcode: int, size: int) -> None:
        """Counts a record within a chunk.

        Args:
            opcode: Type of the record.
            size: Length of the record's content, bytes.

        Raises:
            ExcessError: The file exceeds a limit.
        """
        self._add("messages", 1, self.budget.records)
        if opcode != Opcode.MESSAGE:
            self.frame(opcode, size)

    def name(self, record: McapRecord) -> None:
        """Counts the names in a record: a channel or a schema once, and keys of metadata.

        Raises:
            ExcessError: The file exceeds the limit.
        """
        names = 0
        if isinstance(record, (Channel, Schema)):
            names = int((type(record), record.id) not in self._ids)
            self._ids.add((type(record), record.id))
        elif isinstance(record, Metadata):
            names = 1 + len(record.metadata)
        elif isinstance(record, Attachment):
            names = 1
        self._add("names", names, self.budget.names)

    def _add(self, unit: str, number: int, limit: int) -> None:
        count = self._counts[unit] = self._counts.get(unit, 0) + number
        if count > limit:
            raise ExcessError(
                f"it has more than the {limit} {unit} that a budget of "
                f"{self.budget.memory / 1e9:.3g} GB allows"
            )
