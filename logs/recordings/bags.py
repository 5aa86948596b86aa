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
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path, PurePath

import mcap.records
import zstandard
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.stream_reader import StreamReader
from rosbags import rosbag1
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from selfmodel.errors import InputError
from selfmodel.files import check_regular, file_digest, read_file
from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.recordings import messages
from selfmodel.logs.recordings.recording import Recording, packed, unpacked
from selfmodel.logs.recordings.topics import McapTopics, Stored, Topic

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
    topics: dict[str, Topic] = {}
    files = bag_files(path)
    place, found = count(), _Found()
    for file in files:
        with explained(file):
            for item in _stored(file, found):
                columns = () if wanted is None else wanted.get(item.topic)
                topics.setdefault(item.topic, Topic()).add(item, next(place), columns)
    series = {name: topic.series() for name, topic in topics.items()}
    return packed(Recording(series, found.digests, tuple(found.notes)))


def bag_files(path: Path) -> list[Path]:
    """Returns the files of a bag with its messages, in order."""
    if not path.is_dir():
        check_regular(path, "a bag")
        return [path]
    metadata = path / "metadata.yaml"
    if not metadata.exists():
        return files_in(path)
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


def files_in(folder: Path) -> list[Path]:
    """Returns the files in a folder that have messages, in the order of the numbers in names."""
    storage = [file for file in folder.iterdir() if _STORAGE.search(file.name) and file.is_file()]
    if not storage:
        raise InputError(f"{folder}: expected a bag, got a folder without one: {_EXPECTED}")
    return sorted(storage, key=in_order)


def in_order(path: Path) -> list[tuple[int, str]]:
    """Returns the key by which files are in the order of the numbers in their names."""
    return [(int(part) if part.isdecimal() else 0, part) for part in re.split(r"(\d+)", path.name)]


# ---------------------------------------------------------------- files


@dataclass(frozen=True)
class _Found:
    """SHA-256 of the files of a bag by name, and warnings about them."""

    digests: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _stored(file: Path, found: _Found) -> Iterator[Stored]:
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
            yield from read(file, found)
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


def _mcap(file: Path, found: _Found) -> Iterator[Stored]:
    topics, claimed = McapTopics(), None
    with _HashedReader(file) as opened:
        # No record is larger than its file.
        reader = StreamReader(opened, validate_crcs=True, record_size_limit=opened.size)
        try:
            for record in reader.records:
                if isinstance(record, mcap.records.Statistics):
                    claimed = record.message_count
                if item := topics.stored(record):
                    yield item
            if opened.read(1):
                raise ValueError("bytes follow its end")
        except (EndOfFile, RecordLengthLimitExceeded, struct.error) as failure:
            is_too_long = isinstance(failure, RecordLengthLimitExceeded)
            if _is_closed(file) or (opened.read(1) and not is_too_long):
                raise
            found.notes.append(topics.cut(file))
        # The library skips records of a damaged type: their messages would be missing silently.
        if claimed not in (None, topics.count):
            raise ValueError(f"its statistics have {claimed} messages, its records {topics.count}")
        found.digests[file.name] = opened.hexdigest()


def _is_closed(file: Path) -> bool:
    with file.open("rb") as opened:
        opened.seek(-len(_MCAP_MAGIC), io.SEEK_END)
        return opened.read() == _MCAP_MAGIC


def _sqlite(file: Path, found: _Found) -> Iterator[Stored]:
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


def _rows(file: Path) -> Iterator[Stored]:
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
            number: Stored(str(n), str(t), str(e), defined.get(str(t), ""))
            for number, n, t, e in database.execute(texts)
        }
        yield from topics.values()
        rows = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        for number, time, data in database.execute(rows):
            yield topics[number]._replace(time=time, data=bytes(memoryview(data)))


def _ros1(file: Path, found: _Found) -> Iterator[Stored]:
    found.digests[file.name] = file_digest(file)  # the library reads from many places
    with rosbag1.Reader(file) as reader:
        topics = {
            c.id: Stored(c.topic, c.msgtype, messages.ROS1, c.msgdef.data)
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


_FORMATS: Mapping[bytes, tuple[Callable[[Path, _Found], Iterator[Stored]], str]] = {
    _MCAP_MAGIC: (_mcap, "mcap recover"),
    b"SQLite format 3\0": (_sqlite, "sqlite3 FILE .recover"),
    b"#ROSBAG V": (_ros1, "rosbag reindex"),
}
"""Readers by the first bytes of a file, and tools that recover its intact part."""


@contextmanager
def explained(file: Path) -> Iterator[None]:
    """Makes any error of the libraries that read a file one that says what to do."""
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
