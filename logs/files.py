"""Safe creation of output files: complete or absent, and without replacing an existing file."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from os import PathLike
from pathlib import Path
from typing import IO

from selfmodel.errors import InputError
from selfmodel.logs.atomic import (
    partial_path,
    sync,
    sync_folder,
    write_atomic,
    write_exclusive,
)
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


def write_new(path: Path, data: bytes) -> Path:
    """Writes a new file in one atomic step, and replaces none that was created meanwhile.

    Returns:
        ``path``; if that name was taken, the next one that is free, such as ``NAME-2.html``.

    Raises:
        LogWriteError: Writing failed, and no file is left; or the finished file could not get its
            name, and the error has the name that it has.
    """
    try:
        part = _written(map(partial_path, _numbered(path)), data)
    except OSError as error:
        raise not_written(path, error) from error
    try:
        name = _named(part, _numbered(path))
        sync_folder(path.parent)
    except OSError as error:
        raise not_written(path, error, kept=f"the finished file is {part}: rename it") from error
    return name


def _numbered(path: Path) -> Iterator[Path]:
    """Yields a name, and further ones with a number."""
    yield path
    for number in count(2):
        yield path.with_stem(f"{path.stem}-{number}")


def _written(names: Iterator[Path], data: bytes) -> Path:
    """Writes a file under the first name that is free, and returns the name."""
    for name in names:
        with suppress(FileExistsError):
            write_exclusive(name, data)
            break
    return name


def _named(part: Path, names: Iterator[Path]) -> Path:
    """Gives a complete file the first name that is free, and returns the name."""
    for name in names:
        try:
            os.link(part, name)  # unlike a rename, a link never replaces a file
        except FileExistsError:
            continue
        except OSError:
            # File systems and sandboxes refuse hard links with many errors. An empty file that is
            # created exclusively keeps the name free for a rename.
            return _renamed(part, _written(chain([name], names), b""))
        part.unlink()
        break
    return name


def _renamed(part: Path, empty: Path) -> Path:
    """Renames a complete file to the name of an empty one, and returns the name."""
    try:
        part.replace(empty)
    except OSError:
        with suppress(OSError):  # the first error is the reason
            empty.unlink()
        raise
    return empty


def make_folder(path: Path) -> None:
    """Makes a folder with its parents, unless it exists.

    Raises:
        LogWriteError: The folder cannot be made.
    """
    try:
        with suppress(FileNotFoundError):  # another process removed an empty parent meanwhile
            path.mkdir(parents=True, exist_ok=True)
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path, error) from error


def not_written(
    path: str | PathLike[str],
    cause: OSError,
    kept: str = "files that were finished before are kept",
) -> LogWriteError:
    """Returns the error of a file that is written as a whole."""
    return LogWriteError(path, cause, again="run the command again", kept=kept)


@contextmanager
def as_write_error(path: Path) -> Iterator[None]:
    """Context manager that turns an ``OSError`` into a ``LogWriteError`` that names the file."""
    try:
        yield
    except LogWriteError:
        raise
    except OSError as error:
        raise LogWriteError(path, error) from error
