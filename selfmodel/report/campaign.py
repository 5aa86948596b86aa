"""Report of a campaign: the tables and figures in its folder.

The reader is narrow on purpose: it takes every table (``*.csv``, ``*.jsonl``, and the lists of
``results.json``) and every figure (``*.png``, ``*.svg``) in the folder or in its folder
``figures``, whatever study wrote them.
"""

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.experiments.confidence_intervals import proportion
from selfmodel.files import check_regular, read_file
from selfmodel.report.charts import Cell, Estimate, IntervalChart, Picture, Table
from selfmodel.report.document import Report, Section
from selfmodel.report.recorded.tables import other_lists, read_table, table_files

MEDIA_TYPES = {".png": "image/png", ".svg": "image/svg+xml"}

FIGURES = "figures"

MAX_FIGURE_BYTES = 8_000_000
"""Largest size of all figures together, bytes; those beyond are named instead."""

CORRECT = "correct"
"""Column of the rows of a study: whether a diagnosis is right."""

FACTORS = ("comparator", "method", "robot", "case", "gap", "trials")
"""Columns by which the share of right diagnoses is shown."""

Records = Sequence[Mapping[str, Cell]]


def is_campaign(folder: Path) -> bool:
    """Returns whether a folder has tables of results."""
    return any(table_files(folder))


def report_of_campaign(folder: Path) -> Report:
    """Returns the report of a campaign.

    Args:
        folder: Folder of the campaign.

    Raises:
        InputError: The folder has no table, or a file cannot be read.
    """
    tables = {path.name: read_table(path) for path in table_files(folder)}
    tables = {name: records for name, records in tables.items() if records}
    if not tables:
        raise InputError(
            f"{folder}: expected the folder of a run, or of a campaign with a table such as "
            f"results.csv, got neither"
        )
    judged = [[row for row in one if isinstance(row.get(CORRECT), bool)] for one in tables.values()]
    rows = next(filter(None, judged), ())
    found = [
        _shares(rows) if rows else None,
        Section(
            "tables",
            "Tables",
            ("A heading sorts its table by that column.",),
            tuple(
                _table(name, records) for name, records in {**other_lists(folder), **tables}.items()
            ),
        ),
        _figures(folder),
    ]
    return Report(
        title=f"campaign: {folder.resolve().name}",
        headline=_headline(tables, rows),
        verdict=(),
        sections=tuple(section for section in found if section is not None),
    )


def _headline(tables: Mapping[str, Records], rows: Records) -> str:
    """Returns what the campaign has.

    Args:
        tables: The rows of each table, by its name.
        rows: The rows with a judged diagnosis.
    """
    counts = ", ".join(
        f"{len(records)} {'row' if len(records) == 1 else 'rows'} in {name}"
        for name, records in tables.items()
    )
    if not rows:
        return f"The campaign has {counts}."
    right = sum(bool(row[CORRECT]) for row in rows)
    share = proportion(right, len(rows))
    return (
        f"{right} of {len(rows)} diagnoses are right: {share.estimate:.1%} (95 % interval "
        f"{share.low:.1%} to {share.high:.1%}). Tables: {counts}."
    )


def _shares(rows: Records) -> Section:
    charts = []
    for factor in FACTORS:
        groups: dict[str, list[bool]] = {}
        for row in (row for row in rows if factor in row):
            groups.setdefault(str(row[factor]), []).append(bool(row[CORRECT]))
        if len(groups) > 1:
            charts.append(_share_chart(factor, groups))
    text = "Marginal shares: cells of a campaign that is not finished are not balanced."
    return Section("shares", "Right diagnoses", (text,), tuple(charts))


def _share_chart(factor: str, groups: Mapping[str, Sequence[bool]]) -> IntervalChart:
    shares = {
        name: proportion(sum(groups[name]), len(groups[name]))
        for name in sorted(groups, key=_numbers_first)
    }
    return IntervalChart(
        title=f"Share of right diagnoses by {factor}, with 95 % intervals",
        x_label="share of right diagnoses",
        estimates=tuple(
            Estimate(f"{name} (n = {len(groups[name])})", one.estimate, one.low, one.high)
            for name, one in shares.items()
        ),
        limits=(0.0, 1.0),
    )


def _numbers_first(name: str) -> tuple[float, str]:
    """Sort key of names, of which some are numbers."""
    try:
        value = float(name)
    except ValueError:
        return math.inf, name
    return (math.inf if math.isnan(value) else value), name


def _table(name: str, records: Records) -> Table:
    columns = tuple(dict.fromkeys(key for record in records for key in record))
    rows = tuple(tuple(record.get(column) for column in columns) for record in records)
    return Table(name, columns, rows)


def _figures(folder: Path) -> Section | None:
    shown: list[Picture] = []
    left_out: list[str] = []
    left = MAX_FIGURE_BYTES
    for path in _figure_files(folder):
        check_regular(path, "a figure")
        if path.stat().st_size > left:
            left_out.append(path.name)
            continue
        data = read_file(path, "a figure", left)
        left -= len(data)
        encoded = base64.b64encode(data).decode("ascii")
        shown.append(Picture(path.stem, MEDIA_TYPES[path.suffix], encoded))
    text = f"Left out, because the report would become too large: {', '.join(left_out)}."
    if not shown and not left_out:
        return None
    return Section("figures", "Figures", (text,) if left_out else (), tuple(shown))


def _figure_files(folder: Path) -> Iterator[Path]:
    """Yields the figures, SVG before PNG of the same name."""
    paths = [
        path
        for place in (folder, folder / FIGURES)
        for suffix in (".svg", ".png")
        for path in sorted(place.glob(f"*{suffix}"))
    ]
    seen: set[str] = set()
    for path in paths:
        if path.stem not in seen:
            seen.add(path.stem)
            yield path
