"""Tables in the folder of a campaign, whose cells are shown as they are in their files.

JSON gives each value its type. A column of a CSV file has numbers if each filled cell is one, and
none would lose a digit (``_is_numeric``); other columns have texts. A cell of any column that is
``true`` or ``false`` is a truth value.
"""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.logs.result_files import parse_json
from selfmodel.report.charts import Cell

MAX_FILE_BYTES = 8_000_000
"""Largest table that is read, bytes."""

MAX_INTEGER = 2**53 - 1
"""Largest integer that is a number in the page: JavaScript rounds larger ones."""

LEADING_ZERO = re.compile(r"\s*[+-]?0[0-9]")
"""Beginning of a text such as 007, which is a name and not the number 7."""


def table_files(folder: Path) -> list[Path]:
    """Returns the tables in a folder: CSV files, then those with a JSON object per line."""
    return [path for kind in ("*.csv", "*.jsonl") for path in sorted(folder.glob(kind))]


def read_table(path: Path) -> list[dict[str, Cell]]:
    """Returns the rows of a table, cells by the name of their column.

    Args:
        path: A file of ``table_files``.

    Raises:
        InputError: The file cannot be read.
    """
    data = read_file(path, "a table of results", MAX_FILE_BYTES)
    try:
        text = data.decode("utf-8-sig")  # spreadsheets begin a CSV file with a byte order mark
        if path.suffix == ".csv":
            return _typed(list(csv.DictReader(io.StringIO(text))))
        found = [parse_json(line.encode()) for line in text.split("\n") if line.strip()]
        return [_flat(item) for item in found if isinstance(item, dict)]
    except (ValueError, RecursionError, csv.Error) as error:
        raise InputError(
            f"{path}: expected a table of results: {error}; move it away, and the report is made "
            f"without it"
        ) from error


def other_lists(folder: Path) -> dict[str, list[dict[str, Cell]]]:
    """Returns the lists of ``results.json`` that are in no other table, such as summaries.

    Args:
        folder: Folder of the campaign.

    Raises:
        InputError: The file cannot be read.
    """
    path = folder / "results.json"
    if not path.exists():
        return {}
    known = {path.stem for path in table_files(folder)} | {"rows"}
    try:
        values: Any = parse_json(read_file(path, "the results of a study", MAX_FILE_BYTES))
        lists = {
            name: [_flat(item) for item in items if isinstance(item, dict)]
            for name, items in (values.items() if isinstance(values, dict) else ())
            if isinstance(items, list) and name not in known
        }
        return {name: records for name, records in lists.items() if any(records)}
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: expected the results of a study: {error}; move it away, and the report is "
            f"made without it"
        ) from error


def _flat(item: Mapping[str, Any], prefix: str = "") -> dict[str, Cell]:
    """Returns the values of a JSON object, those of inner objects under joined names."""
    found: dict[str, Cell] = {}
    for key, value in item.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{prefix}{key} ")
        elif isinstance(value, list):
            found[f"{prefix}{key}"] = ", ".join(map(str, value))
        elif isinstance(value, int) and abs(value) > MAX_INTEGER:
            found[f"{prefix}{key}"] = str(value)
        else:
            found[f"{prefix}{key}"] = value
    return found


def _typed(rows: Sequence[Mapping[str, str | None]]) -> list[dict[str, Cell]]:
    """Returns the rows of a CSV file with numbers and truth values."""
    columns = [name for name in (rows[0] if rows else ()) if name]
    numeric = {name for name in columns if _is_numeric(name, [row[name] or "" for row in rows])}
    return [
        {name: _cell(row[name], is_numeric=name in numeric) for name in columns} for row in rows
    ]


def _is_numeric(name: str, cells: Sequence[str]) -> bool:
    """Returns whether each filled cell of a column is a number that keeps all of its digits.

    A cell does not keep them if it has a leading zero, such as 007, is an integer beyond
    ``MAX_INTEGER``, or is a version, by the name of its column: 3.10 is not 3.1.
    """
    return "version" not in name.lower() and all(
        _number(cell) is not None and not LEADING_ZERO.match(cell) for cell in cells if cell
    )


def _number(text: str) -> float | int | None:
    """Returns the number that a text is, NaN and infinity too; None if it is none."""
    if not text.isascii() or "_" in text:  # Python reads 1_000 as a number; it is a name
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    if not text.strip().lstrip("+-").isdigit():
        return value
    # A double is enough to compare, and Python refuses to convert thousands of digits exactly.
    return int(text) if abs(value) <= MAX_INTEGER else None


def _cell(text: str | None, *, is_numeric: bool) -> Cell:
    """Returns a cell of a CSV file: a number, a truth value, a text, or None if it is empty."""
    if not text:
        return None
    if text in ("true", "false", "True", "False"):  # pandas writes the latter
        return text.lower() == "true"
    value = _number(text) if is_numeric else None
    if value is None or math.isinf(value):  # JSON has no infinity
        return text
    return None if math.isnan(value) else value
