"""Reader of rosbag2 bags: a folder, one file or split files, compressed or not."""

import hashlib
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any

import zstandard
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from selfmodel.errors import InputError
from selfmodel.files import check_regular, read_file
from selfmodel.logs.decompress import ZSTD_MAGIC, BombError, unzstd, unzstd_file
from selfmodel.logs.errors import CorruptError, NotMcapError
from selfmodel.logs.framing import MAGIC
from selfmodel.logs.rosbag.stored import Announced, Stored
from selfmodel.logs.rosbag.stored_mcap import read_mcap
from selfmodel.logs.rosbag.stored_sqlite import SQLITE_MAGIC, read_sqlite

METADATA = "metadata.yaml"
EXPECTED = "give a bag's folder, or its .mcap or .db3"
AGAIN = "record it again, or unpack its intact part with the tool of its format"


@dataclass(frozen=True)
class Topic:
    """Topic of a bag.

    Attributes:
        name: Name, such as ``/joint_states``.
        type: Message type, such as ``sensor_msgs/msg/JointState``; "" if unknown.
        encoding: Encoding of the messages; only ``cdr`` is supported.
        count: Number of messages.
    """

    name: str
    type: str
    encoding: str
    count: int


@dataclass(frozen=True)
class Source:
    """File of a bag.

    Attributes:
        name: Name within the bag.
        sha256: SHA-256 of the file, in hexadecimal: recorders write no checksums.
    """

    name: str
    sha256: str


@dataclass(frozen=True)
class Bag:
    """Recording whose files have been read and checked once.

    Attributes:
        path: Path from the user.
        topics: Topics by name.
        sources: Files of the bag, in order.
        files: Readable file, decompressed if necessary, and original name of each source.
    """

    path: Path
    topics: dict[str, Topic]
    sources: tuple[Source, ...]
    files: tuple[tuple[Path, Path], ...]

    def messages(self, wanted: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yields topic, log time in ns and bytes of each message on some topics, file by file.

        Messages are not decoded.

        Raises:
            LogError: A file was damaged meanwhile, or a message cannot be decompressed.
        """
        for file, name in self.files:
            for item in _read(file, name):
                if isinstance(item, Stored) and item.topic in wanted:
                    yield item.topic, item.time, _unpacked(item, name)


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Context manager that yields a bag, and removes decompressed files at the end.

    Args:
        path: Folder of a bag, with or without ``metadata.yaml``, or one of its files.

    Raises:
        LogError: A file is damaged, missing, or not a recording.
        InputError: The bag does not exist, or cannot be read.
    """
    with TemporaryDirectory(prefix="selfmodel-") as folder, _explained(path):
        names = _files(path)
        if not names:
            raise InputError(f"{path}: expected a bag, got a folder without one: {EXPECTED}")
        files = [
            (_ready(name, Path(folder) / str(number)), name) for number, name in enumerate(names)
        ]
        yield Bag(
            path,
            _topics(files),
            tuple(Source(name.name, _sha256(name)) for name in names),
            tuple(files),
        )


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as failure:
        if failure.filename is None or not _within(failure.filename, path):
            raise
        raise InputError(
            f"{path}: expected a bag that can be read, got: {failure.strerror}"
        ) from failure


def _within(filename: object, path: Path) -> bool:
    return Path(str(filename)).absolute().is_relative_to(path.absolute())


def _files(path: Path) -> list[Path]:
    """Storage files of a bag, in order."""
    if not path.is_dir():
        check_regular(path, "a bag")
        return [path]
    if not (path / METADATA).exists():
        found = [name for name in path.iterdir() if _STORAGE.search(name.name) and name.is_file()]
        return sorted(found, key=_natural)
    files = [path / name for name in _listed(path / METADATA)]
    if missing := [file.name for file in files if not file.is_file()]:
        raise CorruptError(
            path,
            f"its {METADATA} lists missing files: {', '.join(missing)}",
            advice=f"add it, or remove {METADATA} to read the files that are there",
        )
    return files


_STORAGE = re.compile(r"\.(mcap|db3)(\.zstd)?$")


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key that orders ``bag_2`` before ``bag_10``."""
    return [(int(part) if part.isdecimal() else 0, part) for part in re.split(r"(\d+)", path.name)]


def _listed(path: Path) -> list[str]:
    """Files in ``metadata.yaml``, without the folder that older versions prepend."""
    try:
        # The base loader returns every value as text.
        data: Any = YAML(typ="base", pure=True).load(read_file(path, METADATA, 2**20))
        listed = data["rosbag2_bagfile_information"]["relative_file_paths"]
    except (YAMLError, ValueError, KeyError, TypeError, RecursionError) as failure:
        reason = re.sub(r"\s+", " ", str(failure))
        raise CorruptError(
            path, f"it cannot be read: {reason}", advice="remove it to do without it"
        ) from failure
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise CorruptError(path, "it lists no files", advice="remove it to do without it")
    return [PurePath(name).name for name in listed]


def _ready(name: Path, place: Path) -> Path:
    """Returns a readable file: the file itself, or its content decompressed to ``place``."""
    if not _begins(name, ZSTD_MAGIC):
        return name
    try:
        unzstd_file(name, place)
    except (BombError, zstandard.ZstdError) as failure:
        raise CorruptError(name, f"it cannot be unpacked: {failure}", advice=AGAIN) from failure
    return place


def _begins(path: Path, magic: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(len(magic)) == magic


def _read(file: Path, name: Path) -> Iterator[Announced | Stored]:
    if _begins(file, SQLITE_MAGIC):
        return read_sqlite(file, name)
    if _begins(file, MAGIC):
        return read_mcap(file, name)
    raise NotMcapError(name, "this is no rosbag2 recording", advice=EXPECTED)


def _topics(files: list[tuple[Path, Path]]) -> dict[str, Topic]:
    kinds: dict[str, dict[tuple[str, str], None]] = {}
    counts: dict[str, int] = {}
    for file, name in files:
        for item in _read(file, name):
            if isinstance(item, Announced):
                kinds.setdefault(item.topic, {})[_full(item.type), item.encoding] = None
            else:
                counts[item.topic] = counts.get(item.topic, 0) + 1
    return {
        topic: Topic(
            topic,
            # A topic of two types fits no role; the error names both types.
            " and ".join(dict.fromkeys(kind for kind, _ in found)),
            " and ".join(dict.fromkeys(encoding for _, encoding in found)),
            counts.get(topic, 0),
        )
        for topic, found in kinds.items()
    }


def _full(kind: str) -> str:
    """Full name of a message type; old recordings omit its ``msg``."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else kind


def _unpacked(item: Stored, name: Path) -> bytes:
    if not item.payload.startswith(ZSTD_MAGIC):
        return item.payload
    try:
        return unzstd(item.payload)
    except (BombError, zstandard.ZstdError) as failure:
        raise CorruptError(
            name, f"a message on {item.topic} cannot be unpacked: {failure}", advice=AGAIN
        ) from failure


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
