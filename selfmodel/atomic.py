"""Files that hold what they held before, or all that was written: never a half."""

import os
from pathlib import Path
from typing import IO


def part_of(path: Path) -> Path:
    """Returns the name that a file has until it is whole."""
    return path.with_name(path.name + ".part")


def put(path: Path, data: bytes) -> None:
    """Puts ``data`` in the place of what a file held before, in one move.

    Raises:
        OSError: It could not be written; the file holds what it held.
    """
    part = part_of(path)
    with part.open("wb") as file:
        file.write(data)
        sync(file)
    part.replace(path)
    sync_folder(path.parent)


def sync(file: IO[bytes]) -> None:
    """Waits until the disk has what was written."""
    file.flush()
    os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Waits until the disk has the names in a folder."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
