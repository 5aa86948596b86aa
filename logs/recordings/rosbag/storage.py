"""Content of one file of a bag, in any format, compressed or not."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import zstandard

from selfmodel.logs.errors import CorruptError, NotMcapError
from selfmodel.logs.mcap.framing import MAGIC
from selfmodel.logs.recordings.rosbag.files import EXPECTED
from selfmodel.logs.recordings.rosbag.stored import Announced, Stored
from selfmodel.logs.recordings.rosbag.stored_mcap import read_mcap
from selfmodel.logs.recordings.rosbag.stored_ros1 import ROS1_MAGIC, read_ros1
from selfmodel.logs.recordings.rosbag.stored_sqlite import SQLITE_MAGIC, read_sqlite

AGAIN = "record it again, or unpack its intact part with the tool of its format"

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame. A CDR message begins with 0."""

_READERS: Mapping[bytes, Callable[[Path, Path], Iterator[Announced | Stored]]] = MappingProxyType(
    {MAGIC: read_mcap, SQLITE_MAGIC: read_sqlite, ROS1_MAGIC: read_ros1}
)
"""Readers by the first bytes of a file."""


def read_storage(name: Path) -> Iterator[Announced | Stored]:
    """Yields the records of a file.

    Args:
        name: The file.

    Raises:
        LogError: The file is damaged, or not a recording.
        OSError: The file cannot be read.
    """
    if not _begins(name, ZSTD_MAGIC):
        yield from _read(name, name)
        return
    place = Path(tempfile.gettempdir()) / "unpacked"
    try:
        _unpack_file(name, place)
        yield from _read(place, name)
    finally:
        place.unlink(missing_ok=True)


def unpacked(payload: bytes, name: Path, topic: str) -> bytes:
    """Returns the bytes of a CDR message that may be compressed with zstd.

    Args:
        payload: Bytes in the file.
        name: Name of the file for an error.
        topic: Name of the topic for an error.

    Raises:
        CorruptError: The message is damaged.
    """
    if not payload.startswith(ZSTD_MAGIC):
        return payload
    try:
        with zstandard.ZstdDecompressor().stream_reader(payload) as reader:
            return reader.readall()
    except zstandard.ZstdError as failure:
        raise CorruptError(
            name, f"a message on {topic} cannot be unpacked: {failure}", advice=AGAIN
        ) from failure


def _unpack_file(name: Path, place: Path) -> None:
    try:
        with name.open("rb") as source, place.open("wb") as target:
            zstandard.ZstdDecompressor().copy_stream(source, target)
    except zstandard.ZstdError as failure:
        raise CorruptError(name, f"it cannot be unpacked: {failure}", advice=AGAIN) from failure


def _begins(path: Path, magic: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(len(magic)) == magic


def _read(file: Path, name: Path) -> Iterator[Announced | Stored]:
    for magic, read in _READERS.items():
        if _begins(file, magic):
            return read(file, name)
    raise NotMcapError(name, "this is no recording of ROS", advice=EXPECTED)
