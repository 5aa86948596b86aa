"""Report of a campaign: the tables and figures in its folder.

The reader is narrow on purpose: it takes every table (``*.csv``, ``*.jsonl``, and the lists of
``results.json``) and every figure (``*.png``, ``*.svg``) in the folder or in its folder
``figures``, whatever study wrote them. Cells are shown as they are in their files: JSON gives each
value its type, and ``_column`` those of a CSV file theirs.
"""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError, counted
from selfmodel.files import check_regular, encodable, read_file
from selfmodel.logs.results import parse_json
from selfmodel.report.charts import Cell, Picture, Report, Section, Table
from selfmodel.report.study import CORRECT, compared, methods_in, recoveries, shares
from selfmodel.studies.rows import LoadedStudy, ablation_notes, kind_of, load
from selfmodel.studies.statistics import proportion

MEDIA_TYPES = {".svg": "image/svg+xml", ".png": "image/png"}
"""Media types of figures; an SVG file is preferred to a PNG file of the same name."""

MAX_FIGURE_BYTES = 8_000_000
"""Largest size of all figures together, bytes; those beyond are named instead."""

MAX_FILE_BYTES = 8_000_000
"""Largest table that is read, bytes."""

MAX_INTEGER = 2**53 - 1
"""Largest integer that is a number in the page: JavaScript rounds larger ones."""

NUMBER = re.compile(r"[+-]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(nan|inf)")
"""A number; not 007, nor 1_000, which Python reads as one: they are names."""

Record = Mapping[str, Cell]
"""A row of a table: cells by the name of their column."""


def report_of_campaign(folder: Path, most_figures: int = MAX_FIGURE_BYTES) -> Report:
    """Returns the report of a campaign, with figures up to a size of all together, bytes.

    Raises:
        InputError: The folder has no table, or a file cannot be read.
    """
    tables = {path.name: read_table(path) for path in _table_files(folder)}
    tables = {name: records for name, records in tables.items() if records}
    if not tables:
        raise InputError(
            f"{folder}: expected the folder of a run with its trials and diagnoses.json, or of a "
            f"campaign with a table such as results.csv, got neither; of a study in Python, write "
            f"its tables first, with write_files(folder, ablation_results(folder).files)"
        )
    every = {**other_lists(folder), **tables}
    shown = tuple(Table.of(encodable(name), records) for name, records in every.items())
    names = (name for name, one in tables.items() if kind_of({key for row in one for key in row}))
    study = load(folder / name) if (name := next(names, "")) else None
    notes: tuple[str, ...] = ()
    if study is not None and study.kind == "ablate":
        notes = ablation_notes(to_json(study.rows.to_dict("records")), folder)
    headline, verdict, found = _findings(study, tables)
    sections = [
        *found,
        Section("tables", "Tables", ("A heading sorts its table by that column.", *notes), shown),
        _figures(folder, most_figures),
    ]
    counts = ", ".join(
        f"{counted(len(records), 'row')} in {encodable(name)}" for name, records in tables.items()
    )
    return Report(
        title=f"campaign: {encodable(folder.resolve().name)}",
        headline=headline or f"The campaign has {counts}.",
        verdict=(*verdict, *notes[1:], f"Tables: {counts}.") if headline else (),
        sections=tuple(section for section in sections if section is not None),
    )


def _findings(
    study: LoadedStudy | None, tables: Mapping[str, Sequence[Record]]
) -> tuple[str, tuple[str, ...], list[Section | None]]:
    """Returns headline, further sentences and sections of what the tables of a campaign show."""
    judged = [[row for row in one if isinstance(row.get(CORRECT), bool)] for one in tables.values()]
    rows = next(filter(None, judged), [])
    if study is not None and study.kind == "suite":
        headline, sections = recoveries(to_json(study.rows.to_dict("records")))
        return headline, (), [*sections, shares(rows, by_method=True)]
    if study is not None and study.outcomes["method"].nunique() > 1:
        headline, best, sections = compared(study)
        return headline, best, [*sections, shares(rows, by_method=False)]
    if not rows:
        return "", (), []
    methods = dict.fromkeys(methods_in(rows))
    headline = f"{counted(len(rows), 'row')} of {counted(len(methods), 'method')}."
    if len(methods) == 1:
        right = sum(bool(row[CORRECT]) for row in rows)
        share = proportion(right, len(rows))
        headline = (
            f"{right} of {len(rows)} diagnoses are right: {share.estimate:.1%} (95 % interval "
            f"{share.low:.1%} to {share.high:.1%})."
        )
    return headline, (), [shares(rows, by_method=True)]


def _figures(folder: Path, most: int) -> Section | None:
    shown: list[Picture] = []
    left_out: list[str] = []
    figures: dict[str, Path] = {}
    for place in (folder, folder / "figures"):
        for suffix in MEDIA_TYPES:
            for path in sorted(place.glob(f"*{suffix}")):
                figures.setdefault(path.stem, path)
    for path in figures.values():
        check_regular(path, "a figure")
        if path.stat().st_size > most:
            left_out.append(encodable(path.name))
            continue
        data = read_file(path, "a figure", most)
        most -= len(data)
        shown.append(Picture(encodable(path.stem), MEDIA_TYPES[path.suffix], data))
    text = f"Left out, because the report would become too large: {', '.join(left_out)}."
    if not shown and not left_out:
        return None
    return Section("figures", "Figures", (text,) if left_out else (), tuple(shown))


def _table_files(folder: Path) -> list[Path]:
    return [path for kind in ("*.csv", "*.jsonl") for path in sorted(folder.glob(kind))]


def read_table(path: Path) -> list[dict[str, Cell]]:
    """Returns the rows of a CSV file, or of a file with a JSON object per line, ``.jsonl``."""
    data = read_file(path, "a table of results", MAX_FILE_BYTES)
    try:
        text = data.decode("utf-8-sig")  # spreadsheets begin a CSV file with a byte order mark
        if path.suffix == ".csv":
            rows = list(csv.DictReader(io.StringIO(text)))
            names = [name for name in (rows[0] if rows else ()) if name]
            columns = [_column(name, [row[name] for row in rows]) for name in names]
            return [dict(zip(names, cells, strict=True)) for cells in zip(*columns, strict=True)]
        items = [parse_json(line.encode()) for line in text.split("\n") if line.strip()]
        return [_flat(item) for item in items if isinstance(item, dict)]
    except (ValueError, RecursionError, csv.Error) as error:
        raise _unreadable(path, "a table of results", error) from error


def other_lists(folder: Path) -> dict[str, list[dict[str, Cell]]]:
    """Returns the lists of ``results.json`` that are in no other table, such as summaries."""
    path = folder / "results.json"
    if not path.exists():
        return {}
    known = {path.stem for path in _table_files(folder)} | {"rows"}
    try:
        values: Any = parse_json(read_file(path, "the results of a study", MAX_FILE_BYTES))
        lists = {
            name: [_flat(item) for item in items if isinstance(item, dict)]
            for name, items in (values.items() if isinstance(values, dict) else ())
            if isinstance(items, list) and name not in known
        }
        return {name: records for name, records in lists.items() if any(records)}
    except (ValueError, RecursionError) as error:
        raise _unreadable(path, "the results of a study", error) from error


def _unreadable(path: Path, what: str, error: Exception) -> InputError:
    return InputError(
        f"{path}: expected {what}: {error}; move it away, and the report is made without it"
    )


def _flat(item: Mapping[str, Any], prefix: str = "") -> dict[str, Cell]:
    """Returns the values of a JSON object, those of inner objects under joined names."""
    flat: dict[str, Cell] = {}
    for key, value in item.items():
        name = encodable(f"{prefix}{key}")
        match value:
            case dict():
                flat |= _flat(value, f"{name} ")
            case list():
                flat[name] = encodable(", ".join(map(str, value)))
            case str():
                flat[name] = encodable(value)
            case int() if abs(value) > MAX_INTEGER:
                flat[name] = str(value)
            case _:
                flat[name] = value
    return flat


def _column(name: str, texts: Sequence[str | None]) -> list[Cell]:
    """Returns a column of a CSV file: truth values, numbers, texts, or None for an empty cell.

    It has numbers if each filled cell is one and keeps all of its digits, unlike an integer beyond
    ``MAX_INTEGER`` and a version, by the name of its column: 3.10 is not 3.1.
    """
    filled = [text for text in texts if text]
    large = any(_is_whole(text) and abs(float(text)) > MAX_INTEGER for text in filled)
    if "version" not in name.lower() and all(map(NUMBER.fullmatch, filled)) and not large:
        return [_number(text) if text else None for text in texts]
    truths = {"true": True, "True": True, "false": False, "False": False}  # pandas' and ours
    return [truths.get(text, text) if text else None for text in texts]


def _number(text: str) -> Cell:
    value = int(text) if _is_whole(text) else float(text)
    if math.isinf(value):  # JSON has no infinity
        return text
    return None if math.isnan(value) else value


def _is_whole(text: str) -> bool:
    return text.lstrip("+-").isdigit()
