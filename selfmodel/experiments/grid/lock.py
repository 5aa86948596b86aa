"""Lock on the folder of a grid: one process at a time runs a grid there."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.logs.files import make_folder


@contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Context manager that reserves the folder of a grid, made if missing, for this process.

    Raises:
        InputError: Another process runs a grid in the folder, or its file system has no locks.
        LogWriteError: The folder cannot be made.
    """
    make_folder(folder)
    place = folder.resolve()  # a folder has one lock, whatever path leads to it
    with place.with_name(f"{place.name}.lock").open("wb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # released when the file is closed
        except BlockingIOError as error:
            raise InputError(
                f"another process runs a grid in {folder}: wait for its end, or choose another "
                f"folder"
            ) from error
        except OSError as error:
            raise InputError(
                f"{folder}: this file system has no locks ({error.strerror}): choose a folder on "
                f"another one"
            ) from error
        yield
