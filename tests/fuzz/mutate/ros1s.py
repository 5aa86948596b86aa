"""Mutations of ROS 1 bags: of the content, with right offsets; and of the records in the file."""

import struct
from collections.abc import Callable

import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import FLOATS, INTEGERS, text
from tests.fuzz.ros1_file import (
    CHUNK,
    INDEX,
    INFO,
    MAGIC,
    MESSAGE,
    Fields,
    Record,
    Ros1File,
    packed_fields,
    parsed_fields,
)


def content_changed(file: Ros1File, rng: np.random.Generator) -> tuple[Ros1File, str]:
    """Returns a bag with one to three changes of its content, and their names."""
    changed = file.copy()
    count = int(rng.integers(1, 4))
    names = [OPERATORS[rng.integers(len(OPERATORS))](changed, rng) for _ in range(count)]
    return changed, "; ".join(names)


def _message(file: Ros1File, rng: np.random.Generator) -> str:
    chunk, at, record = _some_message(file, rng)
    new, what = _payload(record.data, rng)
    chunk[at] = Record(record.fields, new)
    return f"message {at}: {what}"


def _payload(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a message with one mutation; ROS 1 aligns nothing."""
    kind = int(rng.integers(5))
    if kind == 0:
        return data + bytes(int(rng.integers(1, 20))), "longer"
    if kind in (1, 2) and len(data) >= 8:
        new = struct.pack("<d", FLOATS[rng.integers(len(FLOATS))])
        if kind == 1:
            new = (INTEGERS[rng.integers(len(INTEGERS))] % 2**32).to_bytes(4, "little")
        at = int(rng.integers(len(data) - len(new) + 1))
        return data[:at] + new + data[at + len(new) :], f"number at {at}"
    return raw.mutated(data, rng)


def _message_header(file: Ros1File, rng: np.random.Generator) -> str:
    chunk, at, record = _some_message(file, rng)
    fields, what = _field(record.fields, rng)
    chunk[at] = Record(fields, record.data)
    return f"message {at}: {what}"


def _connection(file: Ros1File, rng: np.random.Generator) -> str:
    at = int(rng.integers(len(file.connections)))
    record = file.connections[at]
    if rng.random() < 0.3:
        fields, what = _field(record.fields, rng)
        file.connections[at] = Record(fields, record.data)
    elif rng.random() < 0.3:
        other = parsed_fields(file.connections[rng.integers(len(file.connections))].data)
        key = list(other)[rng.integers(len(other))]
        fields = {**parsed_fields(record.data), key: other[key]}
        file.connections[at] = Record(record.fields, packed_fields(fields))
        what = f"{key!r} of another"
    else:
        fields, what = _field(parsed_fields(record.data), rng)
        file.connections[at] = Record(record.fields, packed_fields(fields))
    return f"connection {at}: {what}"


def _order(file: Ros1File, rng: np.random.Generator) -> str:
    """Removes, doubles or moves a message, a connection or a chunk."""
    lists: list[list[Record] | list[list[Record]]] = [
        file.chunks[rng.integers(len(file.chunks))],
        file.connections,
        file.chunks,
    ]
    which = int(rng.choice(3, p=(0.6, 0.2, 0.2)))
    name = ("message", "connection", "chunk")[which]
    held: list[Record] | list[list[Record]] = lists[which]
    if len(held) < 2:
        return f"no other {name}"
    return f"{name} {_rearranged(held, rng)}"


def _rearranged(held: list, rng: np.random.Generator) -> str:
    at, other = (int(rng.integers(len(held))) for _ in range(2))
    kind = ("removed", "doubled", "moved")[rng.integers(3)]
    item = held[at] if kind == "doubled" else held.pop(at)
    if kind != "removed":
        held.insert(other, item)
    return f"{at} {kind}"


def _some_message(file: Ros1File, rng: np.random.Generator) -> tuple[list[Record], int, Record]:
    found = [
        (chunk, at, record)
        for chunk in file.chunks
        for at, record in enumerate(chunk)
        if record.kind == MESSAGE
    ]
    return found[rng.integers(len(found))]


def _field(fields: Fields, rng: np.random.Generator) -> tuple[Fields, str]:
    """Returns a header with one change."""
    changed = dict(fields)
    name = list(fields)[rng.integers(len(fields))]
    value = fields[name]
    kind = int(rng.integers(6))
    if kind == 0:
        del changed[name]
    elif kind == 1:
        changed[text(rng).encode("utf-8", "replace")] = changed.pop(name)
    elif kind == 2:
        changed[name] = text(rng).encode("utf-8", "replace")
    elif kind == 3 and value:
        changed[name] = raw.mutated(value, rng)[0]
    elif len(value) in (1, 4, 8):
        near = int.from_bytes(value, "little") + int(rng.integers(-2, 3))
        new = near if rng.random() < 0.4 else INTEGERS[rng.integers(len(INTEGERS))]
        changed[name] = (new % 2 ** (8 * len(value))).to_bytes(len(value), "little")
    else:
        changed[name] = (b"", b"\xff\xfe", b"a" * 2000, b"/")[rng.integers(4)]
    return changed, f"{name!r:.20} kind {kind}"


OPERATORS: tuple[Callable[[Ros1File, np.random.Generator], str], ...] = (
    *(_message, _message, _message_header, _connection, _connection, _order),
)


def structure_changed(records: list[Record], rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a file with one change of its records, and its name.

    The bytes of the chunks stay, so that what is read of them must be what was written.
    """
    changed = list(records)
    at = int(rng.integers(len(records)))
    record = records[at]
    kind = int(rng.integers(5))
    if kind == 0:
        what = _rearranged(changed, rng)
    elif kind == 1 and record.kind in (INDEX, INFO):
        entry = 4 * int(rng.integers(len(record.data) // 4))
        (old,) = struct.unpack_from("<I", record.data, entry)
        new = old + int(rng.integers(-2, 3)) if rng.random() < 0.4 else _integer(rng)
        data = record.data[:entry] + struct.pack("<I", new % 2**32) + record.data[entry + 4 :]
        changed[at] = Record(record.fields, data)
        what = f"{at}: number at {entry}"
    elif kind == 2:
        return _with_length(records, at, rng)
    elif kind == 3 and record.kind != CHUNK:
        data, what = raw.mutated(record.data, rng)
        changed[at] = Record(record.fields, data)
        what = f"{at}: data {what}"
    else:
        fields, what = _field(record.fields, rng)
        changed[at] = Record(fields, record.data)
        what = f"{at}: {what}"
    return joined(changed), f"record {what}"


def joined(records: list[Record]) -> bytes:
    """Returns the file of some records."""
    return MAGIC + b"".join(map(bytes, records))


def _with_length(records: list[Record], at: int, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a file where the length of a record's header or content is another."""
    before = joined(records[:at])
    whole = bytes(records[at])
    place = 0 if rng.random() < 0.5 else len(whole) - len(records[at].data) - 4
    new = struct.pack("<I", _integer(rng) % 2**32)
    data = before + whole[:place] + new + whole[place + 4 :]
    return data + b"".join(map(bytes, records[at + 1 :])), f"record {at}: length at {place}"


def _integer(rng: np.random.Generator) -> int:
    return INTEGERS[rng.integers(len(INTEGERS))]
