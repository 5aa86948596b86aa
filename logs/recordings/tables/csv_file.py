"""Reader of CSV files: a line of names, then a line of numbers per sample.

Fields are separated by commas, semicolons, tabs, bars or spaces. Where the separator is no comma,
a decimal comma is read too. Dates of ISO 8601 in the time column are ns since 1970. Errors name
the line and the column.
"""

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables.content import NO_TIME, Content, Numbers, Request

_SEPARATORS = ",;\t|"
_MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "-"})
_WORDS = {"true": 1.0, "false": 0.0}
_DATE = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?)(?:Z|[+-]00:?00)?")
_LONGEST_HEADER = 2**24
_LONGEST_SHOWN = 40


def read_csv(request: Request) -> Content:
    """Returns the wanted columns of a CSV file.

    Raises:
        InputError: The file is no CSV file, or a wanted field is no number.
        OSError: The file cannot be read.
    """
    path = request.path
    with path.open(encoding="utf-8-sig", newline="") as file:
        try:
            return _content(request, file)
        except UnicodeDecodeError as failure:
            raise InputError(
                f"{path}: expected a CSV file in UTF-8, got: {failure.reason}: save it as UTF-8"
            ) from failure


def _content(request: Request, file: TextIO) -> Content:
    path = request.path
    header = file.readline(_LONGEST_HEADER)
    if len(header) == _LONGEST_HEADER:
        raise InputError(
            f"{path}, line 1: expected a line of names, got more than {len(header)} "
            f"characters without a line end: give a CSV file"
        )
    separator = _separator(header)
    file.seek(0)
    rows = csv.reader(file, delimiter=separator, skipinitialspace=True, strict=True)
    lines = _lines(path, rows)
    _, first = next(lines, (1, []))
    names = [name.strip() for name in first]
    names[:1] = [name.lstrip("# ") for name in names[:1]]
    _check_header(request, names)
    places = {name: names.index(name) for name in request.wanted if name in names}
    found: dict[str, list[float]] = {name: [] for name in places}
    comma = separator != ","
    for line, row in lines:
        if len(row) != len(names):
            raise InputError(
                f"{path}, line {line}: expected {len(names)} fields, as in line 1, got {len(row)}: "
                f"correct the line, or remove lines above the names"
            )
        for name, place in places.items():
            try:
                value = _number(row[place], exact=name == request.exact, comma=comma)
            except ValueError:
                raise InputError(
                    f"{path}, line {line}, column {place + 1} ({name}): expected a number, got "
                    f"{_shown(row[place])}: correct it, leave it empty, or name another column"
                ) from None
            found[name].append(value)
    return Content([name for name in names if name], {k: _array(v) for k, v in found.items()})


def _lines(path: Path, rows: Iterator[list[str]]) -> Iterator[tuple[int, list[str]]]:
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


def _separator(header: str) -> str:
    bare = re.sub(r'"[^"]*"', "", header)
    found = max(_SEPARATORS, key=bare.count)
    return found if bare.count(found) or " " not in bare.strip() else " "


def _check_header(request: Request, names: Sequence[str]) -> None:
    path = request.path
    if not any(names):
        raise InputError(f"{path}, line 1: expected names of columns, got an empty file")
    if all(_is_number(name) for name in names):
        raise InputError(
            f"{path}, line 1: expected names of columns, got numbers: add a first line such as "
            f"time,position.front_left_knee,command.front_left_knee"
        )
    request.check_names(names)


def _is_number(text: str) -> bool:
    try:
        _number(text, exact=False, comma=True)
    except ValueError:
        return False
    return True


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
    try:
        if "_" not in text:  # which Python reads in a number
            return float(text)
    except ValueError:
        pass
    word = text.lower()
    if word in _MISSING:
        return np.nan
    if word in _WORDS:
        return _WORDS[word]
    if comma and text.count(",") == 1 and "." not in text and "_" not in text:
        return float(text.replace(",", "."))
    raise ValueError(text)


def _array(values: list[float]) -> Numbers:
    """Values as int64 if all that are not missing are integers, else as float64."""
    kinds = {type(value) for value in values if value == value}  # noqa: PLR0124  # no NaN
    if kinds == {int}:
        whole = [value if type(value) is int else NO_TIME for value in values]
        array = np.array(whole)
        return array if array.dtype == np.int64 else array.astype(np.float64)
    return np.array(values, dtype=np.float64)


def _shown(text: str) -> str:
    return repr(text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}...")
