"""Output files, complete or absent, whose errors name the file and the remedy."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from os import PathLike, path as os_path
from pathlib import Path
from typing import IO

from selfmodel.errors import InputError
from selfmodel.files import give_name, new_file, sync_folder
from selfmodel.logs.errors import LogWriteError


def partial_path(path: Path) -> Path:
    """Returns the name of a trial's log while the trial runs: ``path.part``."""
    return path.with_name(path.name + ".part")


def taken(path: Path) -> InputError:
    """Returns the error of a new file whose name is taken."""
    if path.is_dir():
        return InputError(f"{path} is a folder: give the name of a new file, such as one in it")
    return InputError(f"{path} exists, and is not overwritten: choose another name")


def no_folder(path: Path) -> InputError:
    """Returns the error of a new file whose folder does not exist."""
    return InputError(f"{path}: there is no folder {path.parent}: make it, or choose another")


def refuse_file(folder: Path) -> None:
    """Checks that a folder to write into, or a folder above it, is no file, before any work."""
    for one in (folder, *folder.parents):
        if one.exists() and not one.is_dir():
            raise InputError(f"{one}: expected a folder, got a file: choose another name")


def refuse_existing(path: Path) -> None:
    """Checks that a file, or the unfinished log of its name, does not exist, before any work."""
    names = (path, partial_path(path)) if path.suffix == ".mcap" else (path,)
    for existing in names:
        if os_path.lexists(existing):
            raise taken(existing)


@contextmanager
def create_file(path: Path, *, replace: bool = False) -> Iterator[IO[bytes]]:
    """Opens a file, which gets its name once it is complete; see ``files.new_file``."""
    try:
        with new_file(path, replace=replace) as file:
            yield file
    except FileExistsError:
        raise taken(path) from None
    except (FileNotFoundError, NotADirectoryError):
        raise no_folder(path) from None
    except OSError as error:
        raise not_written(path, error) from error


def replace_file(path: Path, data: bytes) -> None:
    """Writes a file, or replaces its content, in one atomic step."""
    with create_file(path, replace=True) as file:
        file.write(data)


def write_new(path: Path, data: bytes) -> Path:
    """Writes a new file in one atomic step, and replaces none that was created meanwhile.

    Returns the path; if it was taken, the next one that is free, such as ``NAME-2.html``.
    """
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    names = chain([path], numbered)
    while True:
        name = next(names)
        try:
            with new_file(name) as file:
                file.write(data)
        except FileExistsError:
            continue
        except OSError as error:
            raise not_written(name, error) from error
        return name


def publish(part: Path, path: Path) -> None:
    """Renames a complete log that is on the disk."""
    try:
        give_name(part, path)
    except FileExistsError:
        raise InputError(
            f"{path} was created meanwhile, and is not overwritten; the finished file is "
            f"{part}: give it another name"
        ) from None
    sync_folder(path.parent)


def make_folder(path: Path, within: Path | None = None) -> None:
    """Makes a folder with its parents, unless it exists, and flushes their names to the disk.

    Raises:
        InputError: The folder, or one of its parents below ``within``, is a link: what is written
            there would be elsewhere.
        LogWriteError: It cannot be made.
    """
    above = (path, *path.parents)
    for folder in above[: above.index(within)] if within else ():
        if folder.is_symlink():
            raise InputError(f"{folder}: expected a folder, got a link: remove it, or rename it")
    refuse_file(path)
    missing = [folder for folder in above if not folder.exists()]
    try:
        with suppress(FileNotFoundError):  # another process removed an empty parent meanwhile
            path.mkdir(parents=True, exist_ok=True)
        path.mkdir(parents=True, exist_ok=True)
        for folder in missing:
            sync_folder(folder.parent)
    except OSError as error:
        raise not_written(path, error) from error


def not_written(path: str | PathLike[str], cause: OSError) -> LogWriteError:
    """Returns the error of a file that is written as a whole."""
    if isinstance(cause, LogWriteError):
        return cause
    kept = "files that were finished before are kept"
    return LogWriteError(path, cause, again="run the command again", kept=kept)
