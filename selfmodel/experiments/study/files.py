"""Files of a study: their names per robot, tables as CSV and JSON, atomic writing."""

import csv
import dataclasses
import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

from selfmodel import arguments
from selfmodel.errors import InputError
from selfmodel.experiments.grid import FinishedPart
from selfmodel.files import read_file
from selfmodel.logs.files import make_folder, replace_file

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Row = TypeVar("Row", bound="DataclassInstance")


MAX_BYTES = 2**30
"""Largest size of a file of results that is read."""

BOOLEANS = {"true": True, "false": False, "True": True, "False": False}
"""Value by cell of a column of booleans; Python's names are in files of earlier versions."""


def key_of(robot: str) -> str:
    """Returns the robot's part of a file name: its name, or the name of its MJCF or URDF file."""
    name = Path(robot).stem if arguments.is_model(robot) else robot
    return re.sub(r"[^\w.-]", "_", name, flags=re.ASCII).lstrip(".-") or "robot"


def check_keys(robots: Iterable[str]) -> None:
    """Checks that the robots of a study have different file names.

    Raises:
        InputError: Two robots have one file name; the message names both.
    """
    taken: dict[str, str] = {}
    for robot in robots:
        other = taken.setdefault(key_of(robot), robot)
        if other != robot:
            raise InputError(
                f"{other} and {robot} would have the same file names: rename one of the files"
            )


def as_csv(record: "type[DataclassInstance]", rows: Sequence["DataclassInstance"]) -> str:
    """Returns rows as CSV (RFC 4180, with newlines as line ends); None is an empty cell.

    Args:
        record: Class of the rows; its fields are the columns.
        rows: The rows.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [field.name for field in dataclasses.fields(record)]
    writer.writerow(columns)
    for row in rows:
        values = (getattr(row, column) for column in columns)
        writer.writerow(str(v).lower() if isinstance(v, bool) else v for v in values)
    return text.getvalue()


def read_text(path: Path) -> str:
    """Returns the text of a file of results, without the byte order mark of other programs.

    Raises:
        InputError: The file is missing, unreadable, too large, or not in UTF-8.
    """
    try:
        return read_file(path, "the results of a study", MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected results in UTF-8, got other bytes: {error}") from error


def lines_of_csv(path: Path) -> Iterator[list[str]]:
    """Yields the cells of the lines of a CSV file that are not empty.

    Raises:
        InputError: The file cannot be read, or is no CSV.
    """
    try:
        yield from filter(None, csv.reader(io.StringIO(read_text(path), newline=""), strict=True))
    except csv.Error as error:
        raise InputError(f"{path}: expected a CSV file, got {error}") from error


def rows_of_csv(record: "type[Row]", path: Path) -> list["Row"]:
    """Returns the rows of a file that ``as_csv`` wrote; an empty cell is None.

    Args:
        record: Class of the rows. A column with a default may be missing.
        path: The file, with a header.

    Raises:
        InputError: The file is no CSV, a column is missing or unknown, a line has another number of
            cells, or a cell has a value of another type.
    """
    types = {name: get_args(hint) or (hint,) for name, hint in get_type_hints(record).items()}
    fields = dataclasses.fields(record)
    needed = {field.name for field in fields if field.default is dataclasses.MISSING}
    lines = lines_of_csv(path)
    names = next(lines, [])
    if not needed <= set(names) <= types.keys() or len(set(names)) < len(names):
        raise InputError(
            f"{path}: expected the columns {', '.join(types)}, got {', '.join(names)[:300]}"
        )
    rows = []
    for number, cells in enumerate(lines, start=2):
        if len(cells) != len(names):
            raise InputError(
                f"{path}, line {number}: expected {len(names)} cells, got {len(cells)}"
            )
        row = zip(names, cells, strict=True)
        rows.append(
            record(**{name: _of_cell(text, types[name], path, number) for name, text in row})
        )
    return rows


def _of_cell(text: str, types: tuple[type, ...], path: Path, line: int) -> Any:  # noqa: ANN401  # JSON
    """Returns the value of a cell.

    Args:
        text: The cell.
        types: Types of the column, without those of others.
        path: The file, for the message.
        line: Number of the line, for the message.
    """
    if text == "" and type(None) in types:
        return None
    kind = next(one for one in types if one is not type(None))
    try:
        value = BOOLEANS[text] if kind is bool else kind(text)
    except (KeyError, ValueError) as error:
        message = f"{path}, line {line}: expected a {kind.__name__}, got {text!r}"
        raise InputError(message) from error
    if kind is float and not math.isfinite(value):
        raise InputError(f"{path}, line {line}: expected a finite number, got {text!r}")
    return value


def as_rows(record: "type[Row]", part: FinishedPart) -> list["Row"]:
    """Returns the rows in the result of a part.

    Args:
        record: Class of the rows; its annotations are the types of the columns. A column with a
            default may be missing, as in the rows of an earlier version.
        part: The part.

    Raises:
        InputError: A row has other columns, or a value of another type.
    """
    types = {name: get_args(hint) or (hint,) for name, hint in get_type_hints(record).items()}
    fields = dataclasses.fields(record)
    needed = {field.name for field in fields if field.default is dataclasses.MISSING}
    rows = part.result if isinstance(part.result, list) else [part.result]
    for row in rows:
        if not isinstance(row, dict) or not needed <= row.keys() <= types.keys():
            raise _no_row(part, f"a row without the columns {', '.join(types)}")
        for name, value in row.items():
            known = (*types[name], int) if float in types[name] else types[name]
            if type(value) not in known:
                raise _no_row(part, f"{name} = {json.dumps(value)[:80]}")
    return [record(**row) for row in rows]


def _no_row(part: FinishedPart, got: str) -> InputError:
    return InputError(
        f"{part.path}: expected the rows of a cell, got {got}; delete the file, and the same "
        f"command computes its cell again"
    )


def as_dicts(rows: Iterable["DataclassInstance"]) -> list[dict[str, Any]]:
    """Returns rows as JSON."""
    return [dataclasses.asdict(row) for row in rows]


def write_files(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Writes files into a folder, made if missing, and returns their paths.

    Args:
        folder: The folder.
        files: Content by path relative to the folder.

    Raises:
        LogWriteError: A file cannot be written.
    """
    for name, data in files.items():
        make_folder((folder / name).parent)
        replace_file(folder / name, data)
    return tuple(folder / name for name in files)
