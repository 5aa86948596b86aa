"""Table of a recording: columns of numbers by name, with a row per sample.

A child process reads the file, whose content may be hostile; see
``selfmodel.logs.recordings.tables.child``.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

import numpy as np

from selfmodel.errors import InputError
from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.recordings.series import Source
from selfmodel.logs.recordings.tables.content import Numbers

FORMATS: Mapping[str, str] = MappingProxyType(
    {".csv": "CSV", ".tsv": "CSV", ".npz": "NPZ", ".parquet": "Parquet"}
)
"""Formats of tables by the suffix of the file."""

TABLES_EXTRA = "pip install 'selfmodel[tables]'"


@dataclass(frozen=True, eq=False)
class Table:
    """Table whose file has been read once.

    Attributes:
        path: Path from the user.
        format: Name of the format.
        names: Names of all columns that may have numbers, in the order of the file.
        columns: Wanted columns by name, ``(rows,)`` each; integers in the exact column only.
        sources: The file.
    """

    path: Path
    format: str
    names: tuple[str, ...]
    columns: Mapping[str, Numbers]
    sources: tuple[Source, ...]


def is_table(path: Path) -> bool:
    """Returns whether a recording is a table, by its suffix."""
    return path.suffix.lower() in FORMATS


def read_table(path: Path, wanted: Collection[str], *, exact: str = "") -> Table:
    """Returns a table.

    Args:
        path: A file with a suffix of ``FORMATS``.
        wanted: Names of the columns to read; a name that the table does not have is left out.
        exact: Name of the column whose integers are not rounded to float64: times in ns.

    Raises:
        InputError: The file cannot be read, or a wanted column has no numbers.
    """
    form = FORMATS[path.suffix.lower()]
    if form == "Parquet" and find_spec("pyarrow") is None:
        raise InputError(f"{path}: a Parquet file needs pyarrow: {TABLES_EXTRA}")
    request = {
        "path": str(path),
        "folder": str(Path.cwd()),
        "wanted": sorted(wanted),
        "exact": exact,
    }
    module = "parquet_child" if form == "Parquet" else "child"
    found = run_isolated(
        f"selfmodel.logs.recordings.tables.{module}:read",
        Message(request),
        what=str(path),
        seconds=RECORDING_SECONDS,
    )
    columns = {
        name: _numbers(found.buffers[name], kind) for name, kind in found.header["kinds"].items()
    }
    source = Source(path.name, found.header["sha256"])
    return Table(path, form, tuple(found.header["names"]), columns, (source,))


def _numbers(data: bytes, kind: str) -> Numbers:
    if kind == "i":
        return np.frombuffer(data, dtype=np.int64)
    return np.frombuffer(data, dtype=np.float64)
