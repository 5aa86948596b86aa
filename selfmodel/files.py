"""Files that a user names: bounded reading, digests, and writing that is complete or absent."""

import hashlib
import importlib
import os
import re
import secrets
import stat
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from selfmodel.errors import InputError, check_type


def path_of(source: object, what: str) -> Path:
    """Returns a path that is given as a path or a text, or raises ``InputError``."""
    path = os.fspath(source) if isinstance(source, os.PathLike) else source
    check_type(path, str, f"the path of {what}")
    return Path(str(path))


def search_here() -> None:
    """Lets Python import modules of the current folder, as with ``python -m selfmodel``.

    An installed command has no current folder in its path.
    """
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)


def imported(path: str, what: str, name: str = "", others: str = "") -> Any:  # noqa: ANN401  # any object
    """Returns the object that ``package.module:object`` names, or raises ``InputError``.

    The message has what it is, the name that was given for the path, and the end ``others``.
    """
    search_here()
    module, _, attribute = path.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, SyntaxError, TypeError, ValueError) as error:
        moved = isinstance(error, ImportError) and (error.name or "").startswith("selfmodel")
        hint = "; it was written for selfmodel 0.1, whose modules have moved: see the changelog"
        raise InputError(
            f"cannot find the {what} {name or path!r}: {error}{hint if moved else ''}; expected "
            f"package.module:object, importable from here{others}"
        ) from error


def read_file(path: Path, what: str, limit: int) -> bytes:
    """Returns the content of a regular file of at most ``limit`` bytes.

    ``what`` names the expected content for the error message, such as "an MJCF file".

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


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of a file.

    Raises:
        InputError: The file is missing, a folder, a pipe or a device.
        OSError: The file cannot be read.
    """
    check_regular(path, "a file")
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def new_file(path: Path, *, replace: bool = False) -> Iterator[IO[bytes]]:
    """Opens a file that gets its name once all of it is on the disk.

    Until then it has a random name in the same folder, so that two writers of one file do not mix,
    and no remainder of a killed process is in the way. A link of that name is not followed.

    Raises:
        FileExistsError: The name is taken, and is not to be replaced.
        OSError: Writing failed. In any case, no file is left, or the old one.
    """
    part = path.with_name(f".selfmodel-{secrets.token_hex(8)}.part")
    try:
        with part.open("xb") as file:
            yield file
            sync(file)
        if replace:
            part.replace(path)
        else:
            give_name(part, path)
    except BaseException:  # Ctrl-C, too: no half of a file is left
        with suppress(OSError):  # the first error is the reason
            part.unlink(missing_ok=True)  # on a full disk, half a file takes space
        raise
    sync_folder(path.parent)


def give_name(part: Path, path: Path) -> None:
    """Renames a complete file, and replaces none.

    Raises:
        FileExistsError: The name is taken.
        OSError: The file cannot be renamed.
    """
    try:
        os.link(part, path)  # unlike a rename, a link never replaces a file
    except FileExistsError:
        raise
    except OSError:
        # File systems and sandboxes refuse hard links with many errors. An empty file that is
        # created exclusively keeps the name free for a rename.
        path.open("xb").close()
        try:
            part.replace(path)
        except OSError:
            path.unlink()
            raise
    else:
        part.unlink()


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
