"""Safe creation of output files: complete or absent, and without replacing an existing file."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import IO

from selfmodel.errors import InputError
from selfmodel.logs.atomic import partial_path, sync, sync_folder, write_atomic
from selfmodel.logs.errors import LogWriteError


def create_partial(path: Path) -> IO[bytes]:
    """Creates and opens the ``.part`` file that ``publish`` renames to ``path``.

    Raises:
        InputError: ``path`` or its ``.part`` exists, or their folder does not.
        LogWriteError: The file system refused to create the file.
    """
    refuse_existing(path)
    part = partial_path(path)
    try:
        return part.open("xb")
    except FileExistsError:
        raise InputError(f"{part} exists, and is not overwritten: choose another name") from None
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(
            f"{path}: there is no folder {path.parent}: make it, or choose another"
        ) from None
    except OSError as error:
        raise LogWriteError(part, error) from error


def refuse_existing(path: Path) -> None:
    """Checks that neither ``path`` nor its ``.part`` exists, before any work is done.

    Raises:
        InputError: One of the two exists.
    """
    for existing in (path, partial_path(path)):
        if os.path.lexists(existing):
            raise InputError(f"{existing} exists, and is not overwritten: choose another name")


def publish(file: IO[bytes], path: Path) -> None:
    """Closes a complete ``.part`` file, and renames it once its content is on the disk.

    Raises:
        InputError: ``path`` was created meanwhile, or the file system has no hard links; the
            ``.part`` file remains.
        OSError: The disk failed.
    """
    part = partial_path(path)
    sync(file)
    file.close()
    try:
        os.link(part, path)  # unlike a rename, a link never replaces a file
    except FileExistsError:
        raise InputError(
            f"{path} was created meanwhile, and is not overwritten; the finished file is "
            f"{part}: give it another name"
        ) from None
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.ENOTSUP):
            raise
        raise InputError(
            f"{path}: this file system has no hard links ({error.strerror}); the finished file is "
            f"{part}: rename it, and choose another folder for the next"
        ) from error
    part.unlink()
    sync_folder(path.parent)


def replace_file(path: Path, data: bytes) -> None:
    """Writes a file, or replaces its content, in one atomic step.

    Raises:
        LogWriteError: Writing failed; the file keeps its old content.
    """
    try:
        write_atomic(path, data)
    except OSError as error:
        raise not_written(path, error) from error


def make_folder(path: Path) -> None:
    """Makes a folder with its parents, unless it exists.

    Raises:
        LogWriteError: The folder cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path, error) from error


def not_written(path: str | PathLike[str], cause: OSError) -> LogWriteError:
    """Returns the error of a file that is written as a whole."""
    return LogWriteError(
        path, cause, again="run the command again", kept="files that were finished before are kept"
    )


@contextmanager
def as_write_error(path: Path) -> Iterator[None]:
    """Context manager that turns an ``OSError`` into a ``LogWriteError`` that names the file."""
    try:
        yield
    except LogWriteError:
        raise
    except OSError as error:
        raise LogWriteError(path, error) from error
