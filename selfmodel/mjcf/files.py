"""Reads the files that a robot is described in, from one folder and nowhere else."""

import stat
from pathlib import Path

from selfmodel.errors import InputError


def read_file(path: Path, what: str, limit: int) -> bytes:
    """Returns all of a file.

    Args:
        path: The file.
        what: What it should be, such as "an MJCF file".
        limit: Bytes that such a file may have.

    Raises:
        InputError: It cannot be read, is a folder, a pipe or a device, or is larger.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path}: expected {what}, got a folder, a pipe or a device")
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        if isinstance(error, InputError):
            raise
        told = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: expected {what} that can be read, got: {told}") from error
    if len(data) > limit:
        raise InputError(f"{path}: expected {what} of at most {limit} bytes, got more")
    return data


def read_inside(folder: Path, name: str, what: str, limit: int) -> bytes:
    """Returns all of a file in a folder or below it.

    Raises:
        InputError: It is elsewhere, there is none, or it cannot be read.
    """
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):  # a loop of links, a zero byte
        inside = False
    if not inside:
        raise InputError(
            f"it names {what} outside its own folder, {name!r}: put the file into {folder}, "
            f"and name it from there"
        )
    return read_file(path, what, limit)
