"""Files that come to be whole or not at all, and never in the place of another."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from selfmodel.errors import InputError
from selfmodel.logs.atomic import part_of, put, sync, sync_folder
from selfmodel.logs.errors import LogWriteError


def read_bounded(path: Path, what: str, limit: int) -> bytes:
    """Returns all of a file that somebody named.

    Args:
        path: The file.
        what: What it should be, such as "a trial log".
        limit: Bytes that such a file may have.

    Raises:
        InputError: There is none, it cannot be read, is no file but a pipe, a device or a folder,
            or is larger.
    """
    check_regular(path, what)
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except OSError as error:
        raise InputError(
            f"{path}: expected {what} that can be read, got: {error.strerror}"
        ) from error
    if len(data) > limit:
        raise InputError(f"{path}: expected {what} of at most {limit} bytes, got more")
    return data


def check_regular(path: Path, what: str) -> None:
    """Checks that a name is that of a file: a pipe would be waited for, a device never ends.

    Raises:
        InputError: It is not.
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise InputError(
            f"{path}: expected {what} that can be read, got: {error.strerror}"
        ) from error
    if stat.S_ISDIR(mode):
        raise InputError(f"{path}: expected {what} that can be read, got: Is a directory")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: expected {what}, got a pipe or a device: give a file")


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
            f"{path} has come to exist meanwhile, and is not overwritten; the finished file is "
            f"{part_of(path)}: give it another name"
        ) from None
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.ENOTSUP):
            raise
        raise InputError(
            f"{path}: this file system has no hard links ({error.strerror}); the finished file is "
            f"{part_of(path)}: rename it, and choose another folder for the next"
        ) from error
    part_of(path).unlink()
    sync_folder(path.parent)


def replace(path: Path, data: bytes) -> None:
    """Puts ``data`` in the place of what a file held before, in one move.

    Raises:
        LogWriteError: It could not be written; the file holds what it held.
    """
    with explained(part_of(path)):
        put(path, data)


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Says of an error in writing which file it met, and whether the disk is full."""
    try:
        yield
    except LogWriteError:
        raise
    except OSError as error:
        raise LogWriteError(path, error) from error
