"""Reader of tables: columns of numbers by name, with a row per sample, as CSV, NPZ or Parquet.

A child process reads the file, whose content may be hostile.
"""

import csv
import re
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selfmodel.errors import InputError
from selfmodel.files import check_regular, file_digest
from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.npz import NPZ_FAILURES
from selfmodel.logs.recordings.recording import (
    TABLE,
    Column,
    Numbers,
    Recording,
    Series,
    packed,
    unpacked,
)

NO_TIME = np.iinfo(np.int64).min
"""Missing time among integers; numpy's missing date."""

MAX_TIME = 2**62
"""Largest magnitude of a time, ns; sums still fit 64 bits."""


@dataclass(frozen=True, eq=False)
class Table:
    """Table of a file.

    Attributes:
        format: Name of the format.
        names: Names of all columns that may have numbers, in the order of the file.
        columns: Wanted columns by name, ``(rows,)`` each; integers in the exact column only.
        digest: SHA-256 of the file.
    """

    format: str
    names: tuple[str, ...]
    columns: Mapping[str, Numbers]
    digest: str


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
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise InputError(f"{path}: a Parquet file needs pyarrow: pip install 'selfmodel[tables]'")
    request = Message({"path": str(path), "wanted": sorted(wanted), "exact": exact})
    task = "selfmodel.logs.recordings.tables:read_in_child"
    answer = run_isolated(task, request, what=str(path), seconds=RECORDING_SECONDS)
    return unpacked(answer, Table)


def recording_of(path: Path, table: Table, time: str, unit: int) -> Recording:
    """Returns the rows of a table that have a time as a recording.

    Args:
        path: The file.
        table: Its content, with the time column as the exact one.
        time: Name of the time column.
        unit: Unit of its values, ns.

    Raises:
        InputError: A column has another length than the time column, or a time is too large.
    """
    values = table.columns[time]
    for name, column in table.columns.items():
        if len(column) != len(values):
            raise InputError(
                f"{path}: expected {len(values)} rows in {name}, as in {time}, got {len(column)}: "
                f"write columns of the same length"
            )
    rows = np.flatnonzero(np.isfinite(values) & (values != NO_TIME))
    known = values[rows]
    if len(far := np.flatnonzero(np.abs(known) >= MAX_TIME // unit)):
        raise InputError(
            f"{path}: expected times of at most {MAX_TIME / unit:.3g} in {time}, got "
            f"{known[far[0]]:.6g} in row {rows[far[0]] + 1}: check the unit in [time]"
        )
    # An integer of ns has more digits than float64.
    times = known * unit if known.dtype.kind == "i" else np.rint(known * unit).astype(np.int64)
    index = np.arange(len(rows))
    missing = len(values) - len(rows)
    series = Series(
        type=table.format,
        count=len(values),
        stamps=np.zeros(len(rows), dtype=np.int64),
        logged=times,
        names=table.names,
        columns={
            name: Column(index, column[rows, np.newaxis].astype(np.float64))
            for name, column in table.columns.items()
        },
        refused={"without a time": missing} if missing else {},
    )
    return Recording({TABLE: series}, {path.name: table.digest})


def read_in_child(request: Message) -> Message:
    """Task of the child process; see ``read_table``."""
    path, exact = Path(request.header["path"]), request.header["exact"]
    form = FORMATS[path.suffix.lower()]
    check_regular(path, "a table")
    try:
        names, columns = form.read(path, frozenset(request.header["wanted"]), exact)
        digest = file_digest(path)
    except InputError:
        raise
    except (*NPZ_FAILURES, OSError) as failure:
        reason = " ".join(str(failure).split())[:200] or type(failure).__name__
        raise InputError(
            f"{path}: expected a {form.name} file of numbers, got: {reason}: {form.advice}"
        ) from failure
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{path}: {count} columns are called {name!r}: rename all but one")
    arrays = {name: _as_numbers(values, exact=name == exact) for name, values in columns.items()}
    return packed(Table(form.name, tuple(names), arrays, digest))


Content = tuple[list[str], dict[str, NDArray[Any]]]
"""Names of all columns that may have numbers, and the wanted columns."""


def _as_numbers(values: NDArray[Any], *, exact: bool) -> Numbers:
    """Numbers as float64, or as int64 if exact; dates and durations are numbers of ns."""
    if values.dtype.kind in "mM":
        whole = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        return whole if exact else np.where(np.isnat(values), np.nan, whole.astype(np.float64))
    if exact and values.dtype.kind in "iu" and not (values > 2**62).any():
        return values.astype(np.int64)
    return values.astype(np.float64)


# ---------------------------------------------------------------- CSV

_MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "-"})
_WORDS = {"true": 1.0, "false": 0.0}
_DATE = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?)(?:Z|[+-]00:?00)?")


def _read_csv(path: Path, wanted: Collection[str], exact: str) -> Content:
    """Reads a line of names, then a line of numbers per sample.

    Fields are separated by commas, semicolons, tabs, bars or spaces. Where the separator is no
    comma, a decimal comma is read too. Dates of ISO 8601 in the time column are ns since 1970.
    """
    with path.open(encoding="utf-8-sig", newline="") as file:
        separator = _separator(file.readline())
        file.seek(0)
        rows = _rows(
            path, csv.reader(file, delimiter=separator, skipinitialspace=True, strict=True)
        )
        _, header = next(rows, (1, [""]))
        names = [name.strip() for name in (header[0].lstrip("# "), *header[1:])]
        if all(_is_number(name) for name in names):  # an empty one is a missing number
            raise InputError(
                f"{path}, line 1: expected names of columns, got numbers or nothing: add a first "
                f"line such as time,position.front_left_knee,command.front_left_knee"
            )
        places = {name: names.index(name) for name in wanted if name in names}
        columns: dict[str, list[float]] = {name: [] for name in places}
        for line, row in rows:
            if len(row) != len(names):
                raise InputError(
                    f"{path}, line {line}: expected {len(names)} fields, as in line 1, got "
                    f"{len(row)}: correct the line, or remove lines above the names"
                )
            for name, place in places.items():
                try:
                    value = _number(row[place], exact=name == exact, comma=separator != ",")
                except ValueError:
                    raise InputError(
                        f"{path}, line {line}, column {place + 1} ({name}): expected a number, got "
                        f"{row[place][:40]!r}: correct it, leave it empty, or name another column"
                    ) from None
                columns[name].append(value)
    return [name for name in names if name], {k: _array(v) for k, v in columns.items()}


def _separator(header: str) -> str:
    bare = re.sub(r'"[^"]*"', "", header)
    found = max(",;\t|", key=bare.count)
    return found if bare.count(found) or " " not in bare.strip() else " "


def _rows(path: Path, rows: Iterator[list[str]]) -> Iterator[tuple[int, list[str]]]:
    """Yields the rows that are not empty with their lines, from 1."""
    number = 1
    try:
        for row in rows:
            if row:
                yield number, row
            number = rows.line_num + 1  # type: ignore[attr-defined]  # of csv's own reader
    except csv.Error as failure:
        raise InputError(
            f"{path}, line {number}: expected fields of a CSV file, got: {failure}: correct the "
            f"line"
        ) from failure


def _is_number(text: str) -> bool:
    with suppress(ValueError):
        _number(text, exact=False, comma=True)
        return True
    return False


def _number(text: str, *, exact: bool, comma: bool) -> float:
    """Number in a field; NaN for a missing one.

    Raises:
        ValueError: The field is no number.
    """
    text = text.strip()
    if exact and text.lstrip("+-").isdecimal() and len(text) < 20:
        return int(text)
    if exact and (date := _DATE.fullmatch(text)):
        return int(np.datetime64(date[1].replace(" ", "T"), "ns").astype(np.int64))
    word = text.lower()
    if word in _MISSING:
        return np.nan
    if word in _WORDS:
        return _WORDS[word]
    if comma and text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    if "_" in text:  # which Python reads in a number
        raise ValueError(text)
    return float(text)


def _array(values: list[float]) -> NDArray[Any]:
    """Values as int64 if all that are not missing are integers, else as float64."""
    kinds = {type(value) for value in values if value == value}  # noqa: PLR0124  # no NaN
    if kinds == {int}:
        return np.array([value if type(value) is int else NO_TIME for value in values])
    return np.array(values, dtype=np.float64)


# ---------------------------------------------------------------- NPZ


def _read_npz(path: Path, wanted: Collection[str], _exact: str) -> Content:
    """Reads arrays by name.

    An array ``(rows,)`` is a column. An array ``(rows, n)`` is n columns, called by the array's
    name and a label: those of an array of n texts, such as ``joint_names``, or numbers from 0.
    """
    arrays: list[tuple[str, NDArray[Any]]] = []
    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python's, for a header that is a damaged literal
        archive = np.load(file, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile) or archive.zip is None:
            raise ValueError("a single array")
        with archive:
            if damaged := archive.zip.testzip():
                raise ValueError(f"{damaged} with a wrong checksum")
            for name in archive.files:
                with suppress(ValueError):  # an array of objects is no column
                    arrays.append((name, np.asarray(archive[name])))
    labels = {n: tuple(map(str, a)) for n, a in arrays if a.ndim == 1 and a.dtype.kind == "U"}
    columns = [
        (name, values)
        for array, matrix in arrays
        if matrix.dtype.kind in "fiubmM" and 1 <= matrix.ndim <= 2
        for name, values in _columns(array, matrix, labels)
    ]
    return [name for name, _ in columns], {n: v for n, v in columns if n in wanted}


def _columns(
    array: str, matrix: NDArray[Any], labels: Mapping[str, tuple[str, ...]]
) -> list[tuple[str, NDArray[Any]]]:
    if matrix.ndim == 1:
        return [(array, matrix)]
    fitting = {name: some for name, some in labels.items() if len(some) == matrix.shape[1]}
    own = {some for name, some in fitting.items() if name.startswith(array)}
    known = own or set(fitting.values())
    some = known.pop() if len(known) == 1 else range(matrix.shape[1])
    return [(f"{array}.{label}", matrix[:, k]) for k, label in enumerate(some)]


# ---------------------------------------------------------------- Parquet


def _read_parquet(path: Path, wanted: Collection[str], _exact: str) -> Content:
    """Reads columns of numbers, booleans and times; a missing value is NaN."""
    import pyarrow as pa  # noqa: PLC0415  # an extra
    import pyarrow.parquet as pq  # noqa: PLC0415

    # Other allocators reserve large blocks, which exceed the limit of the child's memory.
    pa.set_memory_pool(pa.system_memory_pool())
    types = pa.types
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            numbers = (types.is_integer, types.is_floating, types.is_boolean)
            checks = (*numbers, types.is_timestamp, types.is_duration)
            fields = [f for f in file.schema_arrow if any(check(f.type) for check in checks)]
            names = [field.name for field in fields]
            table = file.read([name for name in names if name in wanted], use_threads=False)
            columns = {
                name: np.asarray(column.cast(pa.int8()) if column.type == pa.bool_() else column)
                for name, column in zip(table.column_names, table.columns, strict=True)
            }
    except pa.ArrowException as failure:
        raise ValueError(str(failure)) from failure
    return names, columns


class Format(NamedTuple):
    """Format of a table: its reader, and what to do about a damaged file."""

    name: str
    read: Callable[[Path, Collection[str], str], Content]
    advice: str


_CSV = Format("CSV", _read_csv, "save it as text in UTF-8")

FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        ".csv": _CSV,
        ".tsv": _CSV,
        ".npz": Format("NPZ", _read_npz, "write it again with numpy.savez"),
        ".parquet": Format("Parquet", _read_parquet, "write it again with DataFrame.to_parquet"),
    }
)
"""Formats of tables by the suffix of the file."""
