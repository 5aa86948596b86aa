"""Bounded reading of files that a user names, and their digests."""

import hashlib
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

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
            # Python reserves as many bytes as it may read.
            data = file.read(min(limit, os.fstat(file.fileno()).st_size) + 1)
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


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of a file.

    Raises:
        InputError: The file is missing, a folder, a pipe or a device.
        OSError: The file cannot be read.
    """
    check_regular(path, "a file")
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _unreadable(path: Path, what: str, error: OSError | ValueError) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"{path}: expected {what} that can be read, got: {reason}")


def encodable(name: str) -> str:
    """Returns the name of a file with bytes that are not UTF-8 escaped: logs are in UTF-8."""
    return name.encode(errors="backslashreplace").decode()


MAX_KEYS = 16
"""Maximum keys joined by dots in a TOML file; selfmodel's have at most four."""

_KEY = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')"""
_DOTTED = re.compile(rf"{_KEY}(?:\s*\.\s*{_KEY})*")
_LONG_NUMBER = re.compile(r"0x[0-9a-fA-F_]{16,}|0o[0-7_]{21,}|0b[01_]{64,}|[0-9_]{19,}")


def load_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text from any source.

    ``tomllib`` takes the square of the number of keys joined by dots, and reads integers that
    Python refuses to print.

    Raises:
        ValueError: The text is not TOML, joins more than ``MAX_KEYS`` keys, nests values too
            deeply, or has an integer of more than 64 bits, which TOML does not.
    """
    for run in _DOTTED.finditer(text):
        if len(re.findall(_KEY, run[0])) > MAX_KEYS:
            raise ValueError(f"more than {MAX_KEYS} keys are joined by dots {_place(text, run)}")
    try:
        loaded = tomllib.loads(text)
    except RecursionError:
        raise ValueError("values are nested too deeply") from None
    except ValueError as failure:
        if isinstance(failure, tomllib.TOMLDecodeError):
            raise
        raise _too_long(text) from None
    values: list[object] = [loaded]
    while values:
        value = values.pop()
        if isinstance(value, dict):
            values += value.values()
        elif isinstance(value, list):
            values += value
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise _too_long(text)
    return loaded


def _too_long(text: str) -> ValueError:
    return ValueError(
        f"an integer has more than 64 bits {_place(text, _LONG_NUMBER.search(text))}".rstrip()
    )


def _place(text: str, found: re.Match[str] | None) -> str:
    """Returns a place in a text in tomllib's words."""
    if found is None:
        return ""
    start = found.start()
    line = text.count("\n", 0, start) + 1
    return f"(at line {line}, column {start - text.rfind(chr(10), 0, start)})"
