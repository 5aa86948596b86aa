"""Search of a damaged file for intact records: records whose own checksum is correct."""

import re
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Metadata, Schema

from selfmodel.logs.errors import ANOTHER, CorruptError, NotMcapError, UnsupportedError
from selfmodel.logs.mcap.contents import MORE_MEMORY, read_bytes
from selfmodel.logs.mcap.framing import (
    FAILURES,
    MAGIC,
    ContradictionError,
    Frame,
    UncheckedError,
    frames,
    parse,
    unpack,
)
from selfmodel.logs.mcap.meter import ExcessError, Meter
from selfmodel.logs.records import OWN, without_digest
from selfmodel.logs.salvage.belonging import Rescued, own_contents
from selfmodel.logs.salvage.findings import Findings
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget


def rescue(path: Path, budget: Budget = DEFAULT_BUDGET) -> Rescued:
    """Returns the intact contents of a damaged log.

    Intact are the chunks and attachments with a correct checksum, and the metadata records of
    selfmodel with a correct digest. After damaged bytes, the search continues at the next intact
    record. Contents of other trials are left out.

    Args:
        path: The file; it is only read.
        budget: Limits of the file.

    Raises:
        LogError: The file is too large, has no record of a log, or has two different messages of
            one time.
        InputError: The file does not exist, or cannot be opened.
    """
    found, meter = Findings(), Meter(budget)
    try:
        for record in _intact_records(read_bytes(path, budget), budget):
            meter.name(record)
            found.add(record)
        rescued = own_contents(found)
    except ContradictionError as error:
        raise CorruptError(path, f"nothing can be salvaged: {error}") from error
    except ExcessError as error:
        what = f"nothing can be salvaged: {error}"
        raise UnsupportedError(path, what, advice=MORE_MEMORY) from error
    if not found.records:
        raise NotMcapError(path, "no record of a trial log is intact in this file", advice=ANOTHER)
    return rescued


def _intact_records(data: bytes, budget: Budget) -> Iterator[McapRecord]:
    """Yields intact records; schemas and channels without a checksum come last."""
    unprotected: list[McapRecord] = []
    work = _Work(budget)
    offset = len(MAGIC)
    while offset < len(data):
        try:
            frame = next(frames(data, offset))
            records = _verified(frame, work)
        except ExcessError:
            raise
        except FAILURES:
            offset = _next_intact(data, offset + 1, work, len(data))
            continue
        if frame.opcode in _PROTECTED and records:
            yield from records
            offset = frame.end
        else:
            unprotected += records
            # Its length has no checksum: the record may contain intact records.
            offset = _next_intact(data, frame.offset + 1, work, frame.end)
    yield from unprotected


_PROTECTED = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)


class _Work:
    """Limits of the search: in hostile bytes, every byte may begin a record."""

    def __init__(self, budget: Budget) -> None:
        self.meter = Meter(budget)
        self._most = 4 * budget.file_bytes
        self._tried = 0

    def attempt(self, frame: Frame) -> None:
        self.meter.frame(frame.opcode, len(frame.body))
        self._tried += len(frame.body)
        if self._tried > self._most:
            raise ExcessError("too many of its bytes could begin a damaged record")


_BEGINNING = re.compile(rb"[\x06\x09\x0c](?=.{3}[\x00-\x10]\x00{4})", re.DOTALL)
"""First bytes of a chunk, an attachment or a metadata record: the opcode, and a length that a file
may have."""


def _verified(frame: Frame, work: _Work) -> list[McapRecord]:
    """Intact records of a frame.

    Raises:
        Exception: One of ``FAILURES``: the frame is damaged, or has no checksum.
    """
    work.attempt(frame)
    record = parse(frame)
    if isinstance(record, Chunk):
        return unpack(record, work.meter)
    if isinstance(record, Attachment) and not any(frame.body[-4:]):
        raise UncheckedError("an attachment has no checksum")
    if isinstance(record, Metadata):
        if not record.name.startswith(OWN):
            return []
        without_digest(record.name, record.metadata)
    kept = isinstance(record, (Attachment, Metadata, Schema, Channel))
    return [record] if kept and record is not None else []


def _next_intact(data: bytes, offset: int, work: _Work, end: int) -> int:
    """Offset of the next intact chunk, attachment or metadata record, or ``end``."""
    for match in _BEGINNING.finditer(data, offset, end):
        try:
            if _verified(next(frames(data, match.start())), work):
                return match.start()
        except ExcessError:
            raise
        except FAILURES:
            continue
    return end
