"""Tables: columns of numbers by name, with a row per sample, as CSV, NPZ or Parquet.

A child process reads a file, whose content may be hostile.
"""

import csv
import re
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray, data_frame
from selfmodel.errors import InputError
from selfmodel.files import check_regular, file_digest
from selfmodel.isolation import RECORDING_SECONDS, Message, run_isolated
from selfmodel.logs.controllers import NPZ_FAILURES
from selfmodel.logs.files import create_file
from selfmodel.logs.recordings.recording import (
    MAX_TIME,
    TABLE,
    Column,
    Recording,
    Series,
    packed,
    unpacked,
)
from selfmodel.trials.trajectory import Trajectory, columns_of

_NO_TIME = np.iinfo(np.int64).min
"""Missing time among integers; numpy's missing date."""

Columns = Mapping[str, FloatArray]

Content = tuple[list[str], dict[str, NDArray[Any]]]
"""Names of all columns that may have numbers, and the wanted columns."""


def is_table(path: Path) -> bool:
    """Returns whether a recording is a table, by its suffix."""
    return path.suffix.lower() in FORMATS


def read_table(path: Path, wanted: Collection[str], *, time: str = "", unit: int = 1) -> Recording:
    """Returns a table; without a time column, its rows have no times.

    A wanted column that the table does not have is left out, and so are rows without a time. The
    unit is that of the times, ns.

    Raises:
        InputError: The file cannot be read, a wanted column has no numbers or another length than
            the time column, or a time is too large.
    """
    _check_parquet(path)
    request = Message({"path": str(path), "wanted": sorted(wanted), "time": time, "unit": unit})
    task = f"{__name__}:read_in_child"
    return unpacked(run_isolated(task, request, what=str(path), seconds=RECORDING_SECONDS))


def read_in_child(request: Message) -> Message:
    """Task of the child process; see ``read_table``."""
    path, time = Path(request.header["path"]), request.header["time"]
    form = FORMATS[path.suffix.lower()]
    check_regular(path, "a table")
    try:
        names, found = form.read(path, frozenset(request.header["wanted"]) | {time} - {""}, time)
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
    columns = {name: _numbers(values) for name, values in found.items()}
    rows, times = np.arange(max(map(len, columns.values()), default=0)), np.zeros(0, dtype=np.int64)
    if time and time in found:
        rows, times = _times(path, time, _exact(found[time]), request.header["unit"])
    count = len(found[time]) if time and time in found else len(rows)
    for name, column in columns.items():
        if len(column) != count:
            raise InputError(
                f"{path}: expected {count} rows in {name}, as in {time or 'the others'}, got "
                f"{len(column)}: write columns of the same length"
            )
    missing = count - len(rows)
    series = Series(
        type=form.name,
        count=count,
        stamps=np.zeros_like(times),
        logged=times,
        places=np.arange(len(times)),
        names=tuple(names),
        columns={
            name: Column(np.arange(len(rows)), column[rows, np.newaxis])
            for name, column in columns.items()
        },
        refused={"without a time": missing} if missing else {},
    )
    return packed(Recording({TABLE: series}, {path.name: digest}))


def _numbers(values: NDArray[Any]) -> FloatArray:
    """Numbers as float64; dates and durations are numbers of ns."""
    if values.dtype.kind in "mM":
        return np.where(np.isnat(values), np.nan, _exact(values).astype(np.float64))
    return values.astype(np.float64)


def _exact(values: NDArray[Any]) -> NDArray[Any]:
    """Times as int64 if they are integers: those in ns have more digits than float64."""
    if values.dtype.kind in "mM":
        return values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
    whole = values.dtype.kind in "iu" and not (values > MAX_TIME).any()
    return values.astype(np.int64 if whole else np.float64)


def _times(
    path: Path, name: str, values: NDArray[Any], unit: int
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Rows that have a time, and their times, ns."""
    rows = np.flatnonzero(np.isfinite(values) & (values != _NO_TIME))
    known = values[rows]
    if len(far := np.flatnonzero(np.abs(known) >= MAX_TIME // unit)):
        raise InputError(
            f"{path}: expected times of at most {MAX_TIME / unit:.3g} in {name}, got "
            f"{known[far[0]]:.6g} in row {rows[far[0]] + 1}: check the unit in [time]"
        )
    return rows, known * unit if known.dtype.kind == "i" else np.rint(known * unit).astype(np.int64)


# ---------------------------------------------------------------- CSV

_MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "-"})
_WORDS = {"true": 1.0, "false": 0.0}
_DATE = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?)(?:Z|[+-]00:?00)?")


def _read_csv(path: Path, wanted: Collection[str], time: str) -> Content:
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
                    value = _number(row[place], exact=name == time, comma=separator != ",")
                except ValueError:
                    raise InputError(
                        f"{path}, line {line}, column {place + 1} ({name}): expected a number, got "
                        f"{row[place][:40]!r}: correct it, leave it empty, or name another column"
                    ) from None
                columns[name].append(value)
    return [name for name in names if name], {k: _array(v) for k, v in columns.items()}


def _separator(header: str) -> str:
    bare = re.sub(r'"[^"]*"', "", header)
    separator = max(",;\t|", key=bare.count)
    return separator if bare.count(separator) or " " not in bare.strip() else " "


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
    """Number in a field; NaN for a missing one."""
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
        return np.array([value if type(value) is int else _NO_TIME for value in values])
    return np.array(values, dtype=np.float64)


def _write_csv(file: IO[bytes], columns: Columns) -> None:
    # The shortest text of each number that is read as the same number.
    data_frame(columns).to_csv(file, mode="wb", index=False, lineterminator="\r\n")


# ---------------------------------------------------------------- NPZ


def _read_npz(path: Path, wanted: Collection[str], _time: str) -> Content:
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
        column
        for name, matrix in arrays
        if matrix.dtype.kind in "fiubmM" and 1 <= matrix.ndim <= 2
        for column in _columns(name, matrix, labels)
    ]
    return [name for name, _ in columns], {n: v for n, v in columns if n in wanted}


def _columns(
    name: str, matrix: NDArray[Any], labels: Mapping[str, tuple[str, ...]]
) -> list[tuple[str, NDArray[Any]]]:
    if matrix.ndim == 1:
        return [(name, matrix)]
    fitting = {label: texts for label, texts in labels.items() if len(texts) == matrix.shape[1]}
    own = {texts for label, texts in fitting.items() if label.startswith(name)}
    known = own or set(fitting.values())
    texts = known.pop() if len(known) == 1 else range(matrix.shape[1])
    return [(f"{name}.{text}", matrix[:, k]) for k, text in enumerate(texts)]


def _write_npz(file: IO[bytes], columns: Columns) -> None:
    np.savez_compressed(file, allow_pickle=False, **columns)


# ---------------------------------------------------------------- Parquet


def _check_parquet(path: Path) -> None:
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise InputError(f"{path}: a Parquet file needs pyarrow: pip install 'selfmodel[tables]'")


def _read_parquet(path: Path, wanted: Collection[str], _time: str) -> Content:
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


def _write_parquet(file: IO[bytes], columns: Columns) -> None:
    data_frame(columns).to_parquet(file, index=False, write_page_checksum=True)


# ---------------------------------------------------------------- formats


class Format(NamedTuple):
    """Format of a table: its reader, what to do about a damaged file, and its writer."""

    name: str
    read: Callable[[Path, Collection[str], str], Content]
    advice: str
    write: Callable[[IO[bytes], Columns], None] | None


FORMATS: Mapping[str, Format] = {
    ".csv": Format("CSV", _read_csv, "save it as text in UTF-8", _write_csv),
    ".tsv": Format("CSV", _read_csv, "save it as text in UTF-8", None),
    ".npz": Format("NPZ", _read_npz, "write it again with numpy.savez", _write_npz),
    ".parquet": Format(
        "Parquet", _read_parquet, "write it again with DataFrame.to_parquet", _write_parquet
    ),
}
"""Formats of tables by the suffix of the file."""


def export(path: Path, trajectory: Trajectory) -> tuple[str, ...]:
    """Writes the observed signals of a trial as a table, which ``logs import`` reads again.

    The file must not exist; its suffix is that of a format. Returns the names of the columns.
    """
    write = writer_of(path)
    columns = columns_of(trajectory)
    with create_file(path) as file:
        write(file, columns)
    return tuple(columns)


def writer_of(path: Path) -> Callable[[IO[bytes], Columns], None]:
    """Returns the writer of a table's format, by the suffix of its file."""
    writers = {suffix: form.write for suffix, form in FORMATS.items() if form.write}
    suffix = path.suffix.lower()
    if suffix not in writers:
        raise InputError(
            f"{path}: expected a file that ends in {', '.join(writers)}, got {suffix or 'no end'}"
        )
    _check_parquet(path)
    return writers[suffix]
