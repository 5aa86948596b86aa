"""Bounded reading of files that a user names."""

import stat
from pathlib import Path

from selfmodel.errors import InputError


def read_file(path: Path, what: str, limit: int) -> bytes:
    """Returns the content of a regular file.

    Args:
        path: The file.
        what: Expected content for the error message, such as "an MJCF file".
        limit: Maximum size, bytes.

    Raises:
        InputError: The file is missing, unreadable, larger than ``limit``, or a folder, a pipe or
            a device.
    """
    check_regular(path, what)
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except OSError as error:
        raise _unreadable(path, what, error) from error
    if len(data) > limit:
        raise InputError(f"{path}: expected {what} of at most {limit} bytes, got more")
    return data


def check_regular(path: Path, what: str) -> None:
    """Checks that a path is a regular file: reading a pipe may block, a device may never end.

    Args:
        path: The file.
        what: Expected content for the error message.

    Raises:
        InputError: The file is missing, a folder, a pipe or a device.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        raise _unreadable(path, what, error) from error
    if stat.S_ISDIR(mode):
        raise InputError(f"{path}: expected {what} that can be read, got: Is a directory")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: expected {what}, got a pipe or a device: give a file")


def _unreadable(path: Path, what: str, error: OSError | ValueError) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"{path}: expected {what} that can be read, got: {reason}")


def encodable(name: str) -> str:
    """Returns the name of a file with bytes that are not UTF-8 escaped: logs are in UTF-8."""
    return name.encode(errors="backslashreplace").decode()
