"""Results of studies: summaries of their rows, and tables in the formats of papers and programs."""

import dataclasses
import io
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median
from types import MappingProxyType
from typing import Any

import pandas as pd

from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.plugins import check_known
from selfmodel.studies import figures
from selfmodel.studies.comparisons import balance_warnings, ends
from selfmodel.studies.rows import (
    KINDS,
    REFERENCE,
    frame_of,
    methods_of,
    outcomes_of,
    study_rows,
    whole,
)
from selfmodel.studies.statistics import UNKNOWN, Interval, proportion, ratio
from selfmodel.studies.study import Row, grouped
from selfmodel.studies.style import figure_style

SINGLE = (1, 2, 3, 5, 6)
"""Numbers of the cases with a single fault."""


def ablation_scores(rows: Sequence[Row]) -> list[Row]:
    """Returns the score of each method per robot, gap and number of trials, over all cases.

    Returns:
        ``robot``, ``gap``, ``comparator``, ``method``, ``trials``; ``runs`` and ``right``, numbers
        of diagnoses; ``correct``, their proportion with Wilson's interval; ``time``, the seconds
        over those of ``REFERENCE`` on the same runs; ``recovery``, the score of the best recovery
        trial over that before the failure. The last two are None without such runs.
    """
    named = [{**row, "method": name} for row, name in zip(rows, methods_of(rows), strict=True)]
    # Times are compared on the same search.
    run = ("robot", "gap", "trials", "truth", "seed", "diagnostic_search")
    reference = {
        tuple(map(row.get, run)): row["seconds"] for row in rows if row["comparator"] == REFERENCE
    }
    names = ("robot", "gap", "comparator", "method", "trials")
    scores = []
    for key, own in sorted(grouped(named, *names).items()):
        times = [
            (row["seconds"], reference[one])
            for row in own
            if (one := tuple(map(row.get, run))) in reference
        ]
        recoveries = [
            (row["recovered"], row["before"])
            for row in own
            if None not in (row["recovered"], row["before"]) and row["before"] > 0
        ]
        scores.append(
            {
                **dict(zip(names, key, strict=True)),
                **_right(own),
                "time": ratio(*zip(*times, strict=True)) if times else None,
                "recovery": ratio(*zip(*recoveries, strict=True)) if recoveries else None,
            }
        )
    return scores


def suite_summaries(rows: Sequence[Row]) -> list[Row]:
    """Returns the summaries of each body: one per case, then one of all single faults.

    Returns:
        ``robot``; ``case`` and ``truth``, None and "" for all single faults; ``runs`` and
        ``right``, their numbers; ``correct``, the proportion of right diagnoses with Wilson's
        interval; the medians of the scores ``before``, ``after`` and ``recovered``; ``recovery``,
        the median of recovered over before, for runs with a score above 0 before; ``upright``, the
        number of runs whose best recovery trial had no fall; the mean number of ``trials``; the
        median of the ``seconds``.
    """
    summaries = []
    for (robot,), own in grouped(rows, "robot").items():
        cases = [(case, same) for (case,), same in sorted(grouped(own, "case").items())]
        cases.append((None, [row for row in own if row["case"] in SINGLE]))
        summaries += [
            {
                "robot": robot,
                "case": case,
                "truth": "" if case is None else same[0]["truth"],
                **_right(same),
                **medians(same, "before", "after", "recovered"),
                "recovery": median(ratios) if (ratios := recovered_over_before(same)) else None,
                "upright": sum(row.get("upright") is True for row in same),
                "trials": fmean(row["trials"] for row in same),
                **medians(same, "seconds"),
            }
            for case, same in cases
            if same
        ]
    return summaries


def _right(rows: Sequence[Row]) -> Row:
    right = sum(row["correct"] for row in rows)
    return {"runs": len(rows), "right": right, "correct": proportion(right, len(rows))}


def medians(rows: Sequence[Row], *names: str) -> Row:
    """Returns the medians of some columns."""
    return {name: median(row[name] for row in rows) for name in names}


def recovered_over_before(rows: Sequence[Row]) -> list[float]:
    """Returns the recovered part of the score before the failure, where that is above 0."""
    return [row["recovered"] / row["before"] for row in rows if row["before"] > 0]


@dataclass(frozen=True)
class Table:
    """A table, whose file has its name: the rows with all digits, and as texts for readers.

    The first columns for readers, ``texts`` of them, are texts, the others numbers.
    """

    name: str
    records: pd.DataFrame
    shown: pd.DataFrame
    texts: int


def table_of(
    name: str,
    records: pd.DataFrame | Sequence[Row],
    shown: Sequence[Mapping[str, str]] | None = None,
    texts: int = 0,
) -> Table:
    """Returns rows as a table.

    Args:
        name: Name of its file, without an extension.
        records: The rows; an interval becomes three columns, as ``correct_low``, and the names of a
            table in a frame one text.
        shown: Their texts for readers, by the title of the column; None for the values themselves.
        texts: Number of leading columns of texts.
    """
    if isinstance(records, pd.DataFrame):
        named = "table" in records
        frame = records.assign(table=records["table"].map(", ".join)) if named else records
    else:
        intervals = {key for row in records for key in row if isinstance(row[key], Interval)}
        frame = frame_of([_flat(record, intervals) for record in records])
    if shown is None:
        values = frame.astype(object).where(frame.notna(), "-").map(str)
        return Table(name, frame, values, len(frame.columns))
    return Table(name, frame, pd.DataFrame(shown), texts)


def _flat(record: Row, intervals: set[str]) -> Row:
    flat: Row = {}
    for key, value in record.items():
        flat |= ends(key, value or UNKNOWN) if key in intervals else {key: value}
    return flat


@dataclass(frozen=True)
class Results:
    """Results of all finished runs of a study.

    Attributes:
        facts: Its rows and summaries, by the keys of ``results.json``.
        tables: Tables of the summaries.
        shown: The table for readers, and ``legend``, the line below it.
        files: Content of its files, by their path in the folder of the study.
        notes: Warnings.
    """

    facts: Mapping[str, Any]
    tables: Sequence[Table]
    shown: Table
    legend: str
    files: Mapping[str, bytes]
    notes: Sequence[str] = field(default=())


def ablation_results(folder: Path, style: str | Path | None = None) -> Results:
    """Returns the results of an ablation, with its figures in a style; see ``figure_style``."""
    rows = study_rows("ablate", folder)
    scores = ablation_scores(rows)
    counts = {one["trials"] for one in scores}
    shown = [one for one in scores if one["trials"] in (min(counts), max(counts))]
    with figure_style(style):
        drawn = figures.of_ablation(rows, scores)
    warnings = balance_warnings(whole(outcomes_of("ablate", rows)))
    facts = {"rows": rows, "scores": scores}
    return Results(
        facts,
        [_score_table(scores)],
        _score_table(shown),
        "With 95 % intervals; time as a multiple of the paper's comparator's.",
        _files("ablate", facts) | {f"figures/{name}": data for name, data in drawn.items()},
        [f"warning: {warning}" for warning in warnings],
    )


def suite_results(folder: Path) -> Results:
    """Returns the results of a study of bodies."""
    facts = {"rows": (rows := study_rows("suite", folder)), "summaries": suite_summaries(rows)}
    texts = list(map(_summary_texts, facts["summaries"]))
    table = table_of("summaries", facts["summaries"], texts, texts=3)
    legend = "Medians over the runs; right with its 95 % interval, %."
    return Results(facts, [table], table, legend, _files("suite", facts))


def _files(name: str, facts: Mapping[str, Any]) -> dict[str, bytes]:
    return {
        "results.csv": csv_bytes(frame_of(facts["rows"], KINDS[name].columns)),
        "results.json": json_bytes(facts),
    }


def _score_table(scores: Sequence[Row]) -> Table:
    has_recovery = any(one["recovery"] for one in scores)
    texts = [
        {
            "robot": one["robot"],
            "gap": f"{one['gap']:g}",
            "method": one["method"],
            "trials": str(one["trials"]),
            "right": f"{one['right']} of {one['runs']}",
            "right, %": _interval(one["correct"], 100, ".0f"),
            "time": _interval(one["time"]),
            **({"recovered ÷ before": _interval(one["recovery"])} if has_recovery else {}),
        }
        for one in scores
    ]
    return table_of("scores", scores, texts, texts=3)


def _summary_texts(one: Row) -> dict[str, str]:
    share = one["correct"]
    interval = f"({100 * share.low:.0f} to {100 * share.high:.0f})"
    return {
        "robot": one["robot"],
        "case": "single faults" if one["case"] is None else str(one["case"]),
        "truth": one["truth"],
        "right": f"{one['right']} of {one['runs']} {interval}",
        **{name: f"{one[name]:.2f}" for name in ("before", "after", "recovered")},
        "recovered ÷ before": "-" if one["recovery"] is None else f"{one['recovery']:.2f}",
        "upright": f"{one['upright']} of {one['runs']}",
        **{name: f"{one[name]:.0f}" for name in ("trials", "seconds")},
    }


def _interval(interval: Interval | None, factor: float = 1, form: str = ".2f") -> str:
    if interval is None:
        return "-"
    estimate, low, high = (format(factor * end, form) for end in dataclasses.astuple(interval))
    known = not math.isnan(interval.low + interval.high)
    return f"{estimate} ({low} to {high})" if known else estimate


def json_bytes(facts: Mapping[str, Any]) -> bytes:
    """Returns rows and summaries as a JSON file."""
    return f"{json.dumps(to_json(facts), indent=1, allow_nan=False)}\n".encode()


def csv_bytes(frame: pd.DataFrame) -> bytes:
    """Returns a frame as CSV (RFC 4180, with newlines as line ends); an unknown value is empty."""
    lower = {True: "true", False: "false"}
    plain = frame.map(lambda value: lower[value] if isinstance(value, bool) else value)
    text: str = plain.to_csv(index=False, lineterminator="\n")
    return text.encode()


def markdown_of(table: Table) -> str:
    """Returns a table in Markdown, with numbers aligned right; nothing without a row."""
    safe = str.maketrans({"\\": "\\\\", "|": "\\|", "\n": " "})
    titles, rows = list(table.shown.columns), table.shown.to_numpy().tolist()
    rule = ["---" if place < table.texts else "---:" for place in range(len(titles))]
    lines = [[text.translate(safe) for text in line] for line in (titles, *rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in (lines[0], rule, *lines[1:]))


def _latex(table: Table) -> bytes:
    sides = "l" * table.texts + "r" * (len(table.shown.columns) - table.texts)
    text = table.shown.style.hide(axis="index").format(_mathematical, escape="latex")
    text = text.format_index(escape="latex", axis="columns")
    latex: str = text.to_latex(column_format=sides, hrules=True)
    return latex.encode()


def _mathematical(text: str) -> str:
    """Returns an escaped text with signs that LaTeX's text fonts lack, or show as a hyphen."""
    return re.sub(r"<|(?<![\w])-(?=[\d.])", lambda sign: f"${sign[0]}$", text)


def _parquet(table: Table) -> bytes:
    data = io.BytesIO()
    try:
        table.records.to_parquet(data, index=False)
    except ImportError as error:
        raise InputError(
            "a Parquet table needs pyarrow, which is not installed: pip install 'selfmodel[tables]'"
        ) from error
    return data.getvalue()


FORMATS: Mapping[str, tuple[str, Callable[[Table], bytes]]] = MappingProxyType(
    {
        "csv": ("csv", lambda table: csv_bytes(table.records)),
        "parquet": ("parquet", _parquet),
        "latex": ("tex", _latex),
        "markdown": ("md", lambda table: markdown_of(table).encode()),
    }
)
"""Suffix and writer by the name of a format. CSV and Parquet files have the records, LaTeX (with
the package booktabs) and Markdown the rows for readers."""

FOR_READERS = ("latex", "markdown")
"""Formats of tables for readers, which have no table of all rows."""


def check_format(wanted: str | None) -> None:
    """Checks, before the work on a table, that it can be written; None is no table."""
    if wanted is not None:
        table_files([table_of("none", [{"n": "1"}])], wanted)


def table_files(tables: Sequence[Table], wanted: str) -> dict[str, bytes]:
    """Returns the content of the files of tables by their name; a table without a row has none."""
    check_known("table format", wanted, FORMATS)
    suffix, write = FORMATS[wanted]
    return {f"{table.name}.{suffix}": write(table) for table in tables if len(table.records)}


def write_files(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Writes files, by their path in a folder, which is made if missing; returns their paths."""
    for name, data in files.items():
        make_folder((folder / name).parent, folder)
        replace_file(folder / name, data)
    return tuple(folder / name for name in files)
