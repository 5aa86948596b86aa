"""Content of a table's file."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selfmodel.errors import InputError
from selfmodel.files import check_regular, file_digest
from selfmodel.isolation import Message

MAX_COLUMNS = 10_000
"""Largest number of columns."""

LONGEST_NAME = 1000
"""Maximum length of a column's name, characters."""

NO_TIME = np.iinfo(np.int64).min
"""Missing time among integers; numpy's missing date."""

Numbers = NDArray[np.float64] | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Content:
    """Content of a file.

    Attributes:
        names: Names of all columns that may have numbers, in the order of the file.
        columns: Wanted columns by name, ``(rows,)`` float64; int64 for integers of the exact one.
    """

    names: Sequence[str]
    columns: Mapping[str, Numbers]


@dataclass(frozen=True)
class Request:
    """File to read.

    Attributes:
        path: The file.
        wanted: Names of the columns to read.
        exact: Name of the column whose integers are not rounded.
    """

    path: Path
    wanted: frozenset[str]
    exact: str

    def check_names(self, names: Sequence[str]) -> None:
        """Checks the names of the columns.

        Raises:
            InputError: A name is too long, or occurs twice.
        """
        if len(names) > MAX_COLUMNS:
            raise InputError(f"{self.path} has more than {MAX_COLUMNS} columns")
        seen: dict[str, int] = {}
        for number, name in enumerate(names, start=1):
            if len(name) > LONGEST_NAME:
                raise InputError(
                    f"{self.path}: expected names of columns of at most {LONGEST_NAME} "
                    f"characters, got one of {len(name)} in column {number}: shorten it"
                )
            if name and name in seen:
                raise InputError(
                    f"{self.path}: the columns {seen[name]} and {number} are both called "
                    f"{name!r}: rename one of them"
                )
            seen[name] = number


def answer(message: Message, read: Callable[[Request], Content]) -> Message:
    """Returns the answer of the child process that reads a table.

    Args:
        message: ``path``, ``folder`` that a relative path begins in, ``wanted`` and ``exact``.
        read: Reader of the format.

    Raises:
        InputError: The file cannot be read.
    """
    header = message.header
    os.chdir(header["folder"])
    path = Path(header["path"])
    check_regular(path, "a table")
    try:
        found = read(Request(path, frozenset(header["wanted"]), header["exact"]))
        digest = file_digest(path)
    except OSError as failure:
        raise InputError(
            f"{path}: expected a table that can be read, got: {failure.strerror or failure}"
        ) from failure
    kinds = {name: values.dtype.kind for name, values in found.columns.items()}
    blobs = {name: values.tobytes() for name, values in found.columns.items()}
    return Message({"names": list(found.names), "kinds": kinds, "sha256": digest}, blobs)


def as_numbers(values: NDArray[Any], *, exact: bool) -> Numbers:
    """Returns an array of numbers as float64, or its integers as int64.

    Args:
        values: Array of any numeric type, or of dates or durations, which are numbers of ns.
        exact: Whether integers are not rounded; a missing date is then ``NO_TIME``.
    """
    if values.dtype.kind in "mM":
        whole = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        return whole if exact else np.where(np.isnat(values), np.nan, whole.astype(np.float64))
    if exact and values.dtype.kind in "iu" and not (values > 2**62).any():
        return values.astype(np.int64)
    return values.astype(np.float64)


def reason_of(failure: Exception) -> str:
    """Returns the message of a library's exception in one line, or the name of its type."""
    return " ".join(str(failure).split())[:200] or type(failure).__name__
