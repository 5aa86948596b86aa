"""Reader of bags of ROS 1 and ROS 2, without ROS.

A bag is a folder of rosbag2 with or without ``metadata.yaml``, one of its MCAP or SQLite files, or
a ROS 1 bag. Checksums and counts of messages are verified where a file has some. A child process
reads the files, whose content may be hostile.
"""

import hashlib
import io
import re
import shlex
import shutil
import sqlite3
import struct
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, NamedTuple

import mcap.records
import numpy as np
import zstandard
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.stream_reader import StreamReader
from rosbags import rosbag1
from rosbags.serde import SerdeError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from selfmodel.errors import InputError
from selfmodel.files import check_regular, file_digest, read_file
from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.recordings import messages
from selfmodel.logs.recordings.recording import (
    MAX_TIME,
    Column,
    Recording,
    Series,
    packed,
    unpacked,
)

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray

_EXPECTED = "give a bag's folder, or its .mcap, .db3 or .bag"
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_STORAGE = re.compile(r"\.(mcap|db3)(\.zstd)?$")


def read_bag(path: Path, topics: Mapping[str, Collection[str]] | None = None) -> Recording:
    """Returns a bag, after a check of all its files.

    Args:
        path: Folder of a rosbag2 bag, or one of its files; or a ROS 1 bag.
        topics: Columns to decode by topic; None for all topics. Only types and counts of the others
            are read. Of a type in ``messages.DECODERS``, all columns are decoded; of another one,
            all of the first message, and of the others those listed.

    Raises:
        InputError: The bag does not exist, is damaged, or cannot be read.
    """
    wanted = None if topics is None else {name: sorted(some) for name, some in topics.items()}
    request = Message({"path": str(path), "topics": wanted})
    task = f"{__name__}:read_in_child"
    return unpacked(run_isolated(task, request, what=str(path), seconds=RECORDING_SECONDS))


def read_in_child(request: Message) -> Message:
    """Task of the child process; see ``read_bag``."""
    path, wanted = Path(request.header["path"]), request.header["topics"]
    topics: dict[str, _Topic] = {}
    files = bag_files(path)
    place, found = count(), _Found()
    for file in files:
        with _explained(file):
            for item in _stored(file, found):
                columns = () if wanted is None else wanted.get(item.topic)
                topics.setdefault(item.topic, _Topic()).add(item, next(place), columns)
    series = {name: topic.series() for name, topic in topics.items()}
    return packed(Recording(series, found.digests, tuple(found.notes)))


def bag_files(path: Path) -> list[Path]:
    """Returns the files of a bag with its messages, in order."""
    if not path.is_dir():
        check_regular(path, "a bag")
        return [path]
    metadata = path / "metadata.yaml"
    if not metadata.exists():
        storage = [file for file in path.iterdir() if _STORAGE.search(file.name) and file.is_file()]
        if not storage:
            raise InputError(f"{path}: expected a bag, got a folder without one: {_EXPECTED}")
        return sorted(storage, key=_natural)
    advice = "add what is missing, or remove it to read the files that are there"
    data = read_file(metadata, "a list of files", 2**20)
    try:
        # The base loader returns every value as text.
        listed = YAML(typ="base", pure=True).load(data)["rosbag2_bagfile_information"]
        # Older versions prepend the folder.
        files = [path / PurePath(name).name for name in listed["relative_file_paths"]]
    except (YAMLError, ValueError, LookupError, TypeError, RecursionError) as failure:
        reason = " ".join(str(failure).split())
        raise InputError(
            f"{metadata}: expected the list of the bag's files, got: {reason}: {advice}"
        ) from failure
    if missing := [file.name for file in files if not file.is_file()]:
        names = ", ".join(missing)
        raise InputError(f"{metadata}: expected files that exist, got {names}: {advice}")
    return files


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(part) if part.isdecimal() else 0, part) for part in re.split(r"(\d+)", path.name)]


# ---------------------------------------------------------------- files


class _Stored(NamedTuple):
    """Message in a file, or without ``data`` the announcement of its topic."""

    topic: str
    type: str
    encoding: str
    definition: str = ""
    time: int = 0
    data: bytes | None = None


@dataclass(frozen=True)
class _Found:
    """SHA-256 of the files of a bag by name, and warnings about them."""

    digests: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _stored(file: Path, found: _Found) -> Iterator[_Stored]:
    """Yields topics and messages of a file in any format, compressed or not."""
    with file.open("rb") as opened:
        head = opened.read(16)
    if head.startswith(messages.ZSTD_MAGIC):
        with tempfile.TemporaryDirectory() as folder, _HashedReader(file) as source:
            plain = Path(folder, file.stem)
            with plain.open("wb") as target:
                zstandard.ZstdDecompressor().copy_stream(source, target)
            yield from _stored(plain, _Found(notes=found.notes))
            found.digests[file.name] = source.hexdigest()
        return
    for magic, (read, _) in _FORMATS.items():
        if head.startswith(magic):
            for item in read(file, found):
                if not (isinstance(item.time, int) and 0 <= item.time < MAX_TIME):
                    raise ValueError(f"a message has the log time {item.time!r} ns")
                yield item
            return
    raise InputError(f"{file}: expected a recording of ROS, got another file: {_EXPECTED}")


class _HashedReader(io.BufferedReader):
    """File that is hashed as it is read; no read exceeds its size, as a damaged length does."""

    def __init__(self, file: Path) -> None:
        super().__init__(io.FileIO(file))
        self.size = file.stat().st_size
        self._hash = hashlib.sha256()

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(-1 if size is None or size > self.size else size)
        self._hash.update(data)
        return data

    def hexdigest(self) -> str:
        """Returns the SHA-256 of the file, after its rest."""
        while self.read(2**20):
            pass
        return self._hash.hexdigest()


def _mcap(file: Path, found: _Found) -> Iterator[_Stored]:
    types, topics = {0: ("", "")}, {}
    number, claimed = 0, None
    with _HashedReader(file) as opened:
        # No record is larger than its file.
        reader = StreamReader(opened, validate_crcs=True, record_size_limit=opened.size)
        try:
            for record in reader.records:
                match record:
                    case mcap.records.Schema():
                        types[record.id] = record.name, messages.text(record.encoding, record.data)
                    case mcap.records.Channel():
                        kind, text = types.get(record.schema_id, ("", ""))
                        encoding = record.message_encoding
                        topics[record.id] = _Stored(record.topic, kind, encoding, text)
                        yield topics[record.id]
                    case mcap.records.Message():
                        number += 1
                        topic = topics[record.channel_id]
                        yield topic._replace(time=record.log_time, data=record.data)
                    case mcap.records.Statistics():
                        claimed = record.message_count
            if opened.read(1):
                raise ValueError("bytes follow its end")
        except (EndOfFile, RecordLengthLimitExceeded, struct.error) as failure:
            is_too_long = isinstance(failure, RecordLengthLimitExceeded)
            if _is_closed(file) or (opened.read(1) and not is_too_long):
                raise
            found.notes.append(
                f"{file.name} has no end, as one that is still being recorded, or whose recorder "
                f"was stopped: {number} messages are read, up to the last whole one"
            )
        # The library skips records of a damaged type: their messages would be missing silently.
        if claimed not in (None, number):
            raise ValueError(f"its statistics have {claimed} messages, its records {number}")
        found.digests[file.name] = opened.hexdigest()


def _is_closed(file: Path) -> bool:
    with file.open("rb") as opened:
        opened.seek(-len(_MCAP_MAGIC), io.SEEK_END)
        return opened.read() == _MCAP_MAGIC


def _sqlite(file: Path, found: _Found) -> Iterator[_Stored]:
    log, journal = (file.with_name(file.name + suffix) for suffix in ("-wal", "-journal"))
    if _has_data(journal):  # SQLite deletes the file that a journal names as its super-journal
        raise InputError(
            f"{file}: its recorder did not close it, and {journal.name} has what its last "
            f"transaction overwrote: roll it back with `sqlite3 {shlex.quote(str(file))} "
            f"'PRAGMA user_version=0'`, if the bag is from a source that you trust"
        )
    if not _has_data(log):
        found.digests[file.name] = file_digest(file)  # SQLite reads from many places
        yield from _rows(file)
        return
    with tempfile.TemporaryDirectory() as folder:
        # The recorder may still write: the digests are those of what is read.
        copies = [Path(shutil.copyfile(path, Path(folder, path.name))) for path in (file, log)]
        found.digests.update({path.name: file_digest(path) for path in copies})
        copy = copies[0]
        with closing(sqlite3.connect(copy)) as database:
            database.execute("PRAGMA journal_mode=DELETE").fetchone()  # merges the log
        yield from _rows(copy)
    found.notes.append(
        f"{file.name} was not closed by its recorder: it was read together with {log.name}, "
        f"up to the last transaction that is complete"
    )


def _has_data(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > 0


def _rows(file: Path) -> Iterator[_Stored]:
    # Immutable: SQLite cannot create its lock files on a read-only disk.
    address = f"{file.resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        # A view has no page, and may be endless.
        tables = {n for (n,) in database.execute("SELECT name FROM sqlite_schema WHERE rootpage")}
        if not tables >= {"topics", "messages"}:
            raise ValueError("it has no tables of topics and messages")
        # Reading a page that is damaged may skip its messages silently.
        (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            raise ValueError(verdict)
        texts = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        is_defined = "message_definitions" in tables  # since Iron
        definitions = database.execute(texts).fetchall() if is_defined else []
        defined = {str(kind): messages.text(e, str(text).encode()) for kind, e, text in definitions}
        texts = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
        topics = {
            number: _Stored(str(n), str(t), str(e), defined.get(str(t), ""))
            for number, n, t, e in database.execute(texts)
        }
        yield from topics.values()
        rows = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        for number, time, data in database.execute(rows):
            yield topics[number]._replace(time=time, data=bytes(memoryview(data)))


def _ros1(file: Path, found: _Found) -> Iterator[_Stored]:
    found.digests[file.name] = file_digest(file)  # the library reads from many places
    with rosbag1.Reader(file) as reader:
        topics = {
            c.id: _Stored(c.topic, c.msgtype, messages.ROS1, c.msgdef.data)
            for c in reader.connections
        }
        yield from topics.values()
        # The library merges topics by time, and so the runs of a clock that restarts.
        entries = sorted(chain(*reader.indexes.values()), key=lambda e: (e.chunk_pos, e.offset))
        first, number = reader.connections[:1], 0
        reader.indexes.update({connection.id: entries for connection in first})
        for connection, time, data in reader.messages(first):
            number += 1
            yield topics[connection.id]._replace(time=time, data=data)
        # The library reads what the index has; the chunks have counts of their own.
        claimed = sum(sum(chunk.connection_counts.values()) for chunk in reader.chunk_infos)
        if claimed != number or len(reader.chunks) != len(reader.chunk_infos):
            raise ValueError(f"its chunks have {claimed} messages, its index {number}")


_FORMATS: Mapping[bytes, tuple[Callable[[Path, _Found], Iterator[_Stored]], str]] = {
    _MCAP_MAGIC: (_mcap, "mcap recover"),
    b"SQLite format 3\0": (_sqlite, "sqlite3 FILE .recover"),
    b"#ROSBAG V": (_ros1, "rosbag reindex"),
}
"""Readers by the first bytes of a file, and tools that recover its intact part."""


@contextmanager
def _explained(file: Path) -> Iterator[None]:
    try:
        yield
    except (InputError, MemoryError):
        raise
    except Exception as failure:  # the libraries and their decompressors raise anything
        if isinstance(failure, OSError) and failure.filename is not None:
            raise InputError(
                f"{file}: expected a bag that can be read, got: {failure.strerror}"
            ) from failure
        reason = ": ".join(filter(None, (type(failure).__name__, str(failure))))
        tools = " or ".join(f"`{tool}`" for _, tool in _FORMATS.values())
        raise InputError(
            f"{file}: the bag is damaged, or ends too early: {reason}: record it again, or recover "
            f"its intact part with the tool of its format, {tools}"
        ) from failure


# ---------------------------------------------------------------- topics


@dataclass
class _Topic:
    """Topic of a bag, with the messages that were decoded.

    Attributes:
        types: Message types, one in nearly every bag.
        times: Time stamp (0 without one) and log time of each decoded message, ns, and its place
            in the bag.
        layouts: Indices and rows of these by the names in them, nearly always the same.
        refused: Numbers of messages left out, by reason.
        listed: Columns to decode of the messages after the first.
        absent: Those that the first does not have: a list in another one may be longer.
    """

    types: dict[str, None] = field(default_factory=dict)
    count: int = 0
    times: list[tuple[int, int, int]] = field(default_factory=list)
    layouts: dict[tuple[str, ...], list[tuple[int, "FloatArray"]]] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)
    listed: tuple[str, ...] = ()
    absent: frozenset[str] = frozenset()

    def add(self, item: _Stored, place: int, columns: Collection[str] | None) -> None:
        """Adds a message, or an announcement; ``columns`` of it, all if empty, or None."""
        package, _, name = item.type.rpartition("/")
        kind = item.type if package.endswith("/msg") else f"{package}/msg/{name}"  # old bags
        known = item.encoding in (messages.CDR, messages.ROS1)
        self.types[(kind if package else name) + ("" if known else f" in {item.encoding!r}")] = None
        if item.data is None:
            return
        self.count += 1
        by_place = kind not in messages.DECODERS
        is_done = by_place and self.layouts and not self.listed
        if columns is None or not known or not package or is_done:
            return
        try:
            stamp, (names, rows) = messages.decode(
                item.data, kind, item.encoding, item.definition, self.listed
            )
        except (messages.UndefinedError, SerdeError) as failure:
            # Only a suggestion decodes what nobody has asked for.
            if isinstance(failure, SerdeError) and (columns or not by_place):
                raise
            return
        except messages.RefusedError as refused:
            self.refused[str(refused)] += 1
            return
        if by_place and not self.layouts:
            self.listed = tuple(columns)
            self.absent = frozenset(columns) - set(names)
            rows = np.append(rows, np.full((len(self.absent), 1), np.nan), axis=0)
            names = (*names, *sorted(self.absent))
        if names or not by_place:
            self.layouts.setdefault(names, []).append((len(self.times), rows))
            self.times.append((stamp, item.time, place))

    def series(self) -> Series:
        """Returns the messages as arrays; a column may be in messages of several layouts."""
        parts: dict[str, list[Column]] = {}
        for names, decoded in self.layouts.items():
            indices, blocks = zip(*decoded, strict=True)
            index, rows = np.array(indices, dtype=np.int64), np.array(blocks)
            for k, name in enumerate(names):
                parts.setdefault(name, []).append(Column(index, rows[:, k]))
        columns = {}
        for name, some in parts.items():
            index = np.concatenate([part.index for part in some])
            order = np.argsort(index)
            values = np.concatenate([part.values for part in some])
            if name not in self.absent or not np.isnan(values).all():
                columns[name] = Column(index[order], values[order])
        stamps, logged, places = np.array(self.times, dtype=np.int64).reshape(-1, 3).T
        kind, names, count = " and ".join(self.types), tuple(columns), self.count
        by_place = bool(columns) and not self.types.keys() & messages.DECODERS.keys()
        return Series(
            kind, count, stamps, logged, places, names, columns, self.refused, by_place=by_place
        )
