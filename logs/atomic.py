"""Atomic writes: a file holds its old content or all of its new content."""

import os
from contextlib import suppress
from pathlib import Path
from typing import IO


def partial_path(path: Path) -> Path:
    """Returns the name of a file until it is complete: ``path.part``."""
    return path.with_name(path.name + ".part")


def write_atomic(path: Path, data: bytes) -> None:
    """Writes a file, or replaces its content, in one atomic step.

    Raises:
        OSError: Writing failed; the file keeps its old content.
    """
    part = partial_path(path)
    try:
        with part.open("wb") as file:
            file.write(data)
            sync(file)
        part.replace(path)
    except OSError:
        with suppress(OSError):  # the first error is the reason
            part.unlink(missing_ok=True)  # on a full disk, half a file takes space
        raise
    sync_folder(path.parent)


def write_exclusive(path: Path, data: bytes) -> None:
    """Writes a file that does not exist yet.

    Raises:
        FileExistsError: The file exists; it is unchanged.
        OSError: Writing failed; no file is left.
    """
    with path.open("xb") as file:
        try:
            file.write(data)
            sync(file)
        except OSError:
            with suppress(OSError):  # the first error is the reason
                path.unlink()
            raise


def sync(file: IO[bytes]) -> None:
    """Flushes a file to the disk."""
    file.flush()
    os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Flushes the names in a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
