"""Search of a damaged file for intact records: records whose own checksum is correct."""

import re
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Metadata, Schema

from selfmodel.logs.errors import ANOTHER, CorruptError, NotMcapError
from selfmodel.logs.mcap.contents import read_bytes
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
from selfmodel.logs.records import OWN, without_digest
from selfmodel.logs.salvage.belonging import Rescued, own_contents
from selfmodel.logs.salvage.findings import Findings


def rescue(path: Path) -> Rescued:
    """Returns the intact contents of a damaged log.

    Intact are the chunks and attachments with a correct checksum, and the metadata records of
    selfmodel with a correct digest. After damaged bytes, the search continues at the next intact
    record. Contents of other trials are left out.

    Args:
        path: The file; it is only read.

    Raises:
        LogError: The file is too large, has no record of a log, or has two different messages of
            one time.
        InputError: The file does not exist, or cannot be opened.
    """
    found = Findings()
    try:
        for record in _intact_records(read_bytes(path)):
            found.add(record)
        rescued = own_contents(found)
    except ContradictionError as error:
        raise CorruptError(path, f"nothing can be salvaged: {error}") from error
    if not found.records:
        raise NotMcapError(path, "no record of a trial log is intact in this file", advice=ANOTHER)
    return rescued


def _intact_records(data: bytes) -> Iterator[McapRecord]:
    """Yields intact records; schemas and channels without a checksum come last."""
    unprotected: list[McapRecord] = []
    work = _Work()
    offset = len(MAGIC)
    while offset < len(data):
        try:
            frame = next(frames(data, offset))
            records = _verified(frame, work)
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

    def __init__(self) -> None:
        self._most = 4 * 2**30
        self._tried = 0

    def attempt(self, frame: Frame) -> None:
        self._tried += len(frame.body)
        if self._tried > self._most:
            raise ContradictionError("too many of its bytes could begin a damaged record")


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
        return unpack(record)
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
        except FAILURES:
            continue
    return end
