"""Files that hold what they held before, or all that was written: never a half."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Waits until no other process is alone in a folder, and then keeps the others waiting.

    Only those that ask in the same way are kept out; a process that dies lets them in.
    """
    with (folder / "lock").open("wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # given up when the file is closed
        yield
