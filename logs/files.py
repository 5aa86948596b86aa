"""Files that come to be whole or not at all, and never in the place of another."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from selfmodel.errors import InputError
from selfmodel.logs.errors import LogWriteError


def part_of(path: Path) -> Path:
    """Returns the name that a file has until it is whole."""
    return path.with_name(path.name + ".part")


def create_part(path: Path) -> IO[bytes]:
    """Opens the unfinished file that is to become ``path``.

    Raises:
        InputError: Either of them exists, or their folder does not.
        LogWriteError: It could not be made.
    """
    refuse_existing(path)
    try:
        return part_of(path).open("xb")
    except FileExistsError:
        raise InputError(
            f"{part_of(path)} exists, and is not overwritten: choose another name"
        ) from None
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(
            f"{path}: there is no folder {path.parent}: make it, or choose another"
        ) from None
    except OSError as error:
        raise LogWriteError(part_of(path), error) from error


def refuse_existing(path: Path) -> None:
    """Refuses a name that is taken, before any work is done for it.

    Raises:
        InputError: A file of that name exists, or one that is to become it.
    """
    for existing in (path, part_of(path)):
        if os.path.lexists(existing):
            raise InputError(f"{existing} exists, and is not overwritten: choose another name")


def publish(file: IO[bytes], path: Path) -> None:
    """Closes a finished part, and gives it its name once the disk has it.

    Raises:
        InputError: ``path`` has come to exist meanwhile, or the file system has no hard links;
            the part stays.
        OSError: The disk failed.
    """
    sync(file)
    file.close()
    try:
        os.link(part_of(path), path)  # unlike a rename, this never replaces a file
    except FileExistsError:
        raise InputError(
            f"{path} has come to exist meanwhile, and is not overwritten; the finished log is "
            f"{part_of(path)}: give it another name"
        ) from None
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.ENOTSUP):
            raise
        raise InputError(
            f"{path}: this file system has no hard links ({error.strerror}); the finished log is "
            f"{part_of(path)}: rename it, and choose another folder for the next"
        ) from error
    part_of(path).unlink()
    sync_folder(path.parent)


def replace(path: Path, data: bytes) -> None:
    """Puts ``data`` in the place of what a file held before, in one move.

    Raises:
        LogWriteError: It could not be written; the file holds what it held.
    """
    part = part_of(path)
    with explained(part):
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
def explained(path: Path) -> Iterator[None]:
    """Says of an error in writing which file it met, and whether the disk is full."""
    try:
        yield
    except LogWriteError:
        raise
    except OSError as error:
        raise LogWriteError(path, error) from error
