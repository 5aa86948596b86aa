"""A ROS 1 bag as chunks of records, which can be changed and written with right offsets.

Format 2.0: http://wiki.ros.org/Bags/Format/2.0.
"""

import bz2
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import lz4.frame

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, HEADER, INDEX, CHUNK, INFO, CONNECTION = (bytes([code]) for code in range(2, 8))
_HEADER_SIZE = 4096

COMPRESSIONS: Mapping[bytes, Callable[[bytes], bytes]] = MappingProxyType(
    {b"none": lambda data: data, b"bz2": bz2.compress, b"lz4": lz4.frame.compress}
)

Fields = dict[bytes, bytes]
"""Values by name, in the header of a record."""


@dataclass(frozen=True)
class Record:
    """Record of a bag.

    Attributes:
        fields: Header.
        data: Content.
    """

    fields: Fields
    data: bytes

    @property
    def kind(self) -> bytes:
        """Operation code; empty if there is none."""
        return self.fields.get(b"op", b"")

    def __bytes__(self) -> bytes:
        """The record in a file."""
        head = packed_fields(self.fields)
        return b"".join([_size(head), head, _size(self.data), self.data])


@dataclass
class Ros1File:
    """Content of a bag.

    Attributes:
        connections: Connection records of the index.
        chunks: Connection and message records of each chunk.
    """

    connections: list[Record]
    chunks: list[list[Record]]

    def copy(self) -> "Ros1File":
        """Returns a copy whose records can be replaced."""
        return Ros1File(list(self.connections), [list(chunk) for chunk in self.chunks])


def read_file(data: bytes) -> Ros1File:
    """Returns the records of an undamaged bag without compression."""
    every = _records(data[len(MAGIC) :])
    return Ros1File(
        [record for record in every if record.kind == CONNECTION],
        [_records(record.data) for record in every if record.kind == CHUNK],
    )


def laid_out(file: Ros1File, compression: bytes) -> list[Record]:
    """Returns all records of a bag with right counts and offsets, in the order of the file."""
    at = len(MAGIC) + _HEADER_SIZE
    records: list[Record] = []
    infos: list[Record] = []
    for chunk in file.chunks:
        entries = _entries(chunk)
        times = [time for found in entries.values() for time, _ in found] or [bytes(8)]
        infos.append(
            Record(
                {
                    b"op": INFO,
                    b"ver": number(1),
                    b"chunk_pos": struct.pack("<Q", at),
                    b"start_time": min(times, key=_nanoseconds),
                    b"end_time": max(times, key=_nanoseconds),
                    b"count": number(len(entries)),
                },
                b"".join(conn + number(len(found)) for conn, found in entries.items()),
            )
        )
        whole = b"".join(map(bytes, chunk))
        head = {b"op": CHUNK, b"compression": compression, b"size": number(len(whole))}
        body = [Record(head, COMPRESSIONS[compression](whole))]
        body += [_index(conn, found) for conn, found in entries.items()]
        at += sum(len(bytes(record)) for record in body)
        records += body
    head = {
        b"op": HEADER,
        b"index_pos": struct.pack("<Q", at),
        b"conn_count": number(len(file.connections)),
        b"chunk_count": number(len(file.chunks)),
    }
    first = Record(head, b"")
    first = replace(first, data=b" " * (_HEADER_SIZE - len(bytes(first))))
    return [first, *records, *file.connections, *infos]


def number(value: int) -> bytes:
    """Returns a number of 4 bytes."""
    return struct.pack("<I", value)


def packed_fields(fields: Fields) -> bytes:
    """Returns the bytes of a header."""
    items = [name + b"=" + value for name, value in fields.items()]
    return b"".join(_size(item) + item for item in items)


def parsed_fields(data: bytes) -> Fields:
    """Returns an undamaged header."""
    fields: Fields = {}
    at = 0
    while at < len(data):
        item, at = _block(data, at)
        name, _, value = item.partition(b"=")
        fields[name] = value
    return fields


def _records(data: bytes) -> list[Record]:
    records = []
    at = 0
    while at < len(data):
        head, at = _block(data, at)
        content, at = _block(data, at)
        records.append(Record(parsed_fields(head), content))
    return records


def _block(data: bytes, at: int) -> tuple[bytes, int]:
    """Bytes after their length, and the offset of their end."""
    (size,) = struct.unpack_from("<I", data, at)
    end = at + 4 + size
    return data[at + 4 : end], end


def _entries(chunk: list[Record]) -> dict[bytes, list[tuple[bytes, int]]]:
    """Time and offset of the messages of a chunk, by connection."""
    entries: dict[bytes, list[tuple[bytes, int]]] = {}
    at = 0
    for record in chunk:
        conn, time = record.fields.get(b"conn", b""), record.fields.get(b"time", b"")
        if record.kind == MESSAGE and (len(conn), len(time)) == (4, 8):
            entries.setdefault(conn, []).append((time, at))
        at += len(bytes(record))
    return entries


def _index(conn: bytes, entries: list[tuple[bytes, int]]) -> Record:
    head = {b"op": INDEX, b"ver": number(1), b"conn": conn, b"count": number(len(entries))}
    return Record(head, b"".join(time + number(offset) for time, offset in entries))


def _nanoseconds(time: bytes) -> int:
    seconds, rest = struct.unpack("<II", time)
    return int(seconds * 10**9 + rest)


def _size(data: bytes) -> bytes:
    return number(len(data))
