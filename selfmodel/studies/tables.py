"""Tables of studies: summaries of their rows, and files in the formats of papers and programs."""

import dataclasses
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Any

import pandas as pd

from selfmodel.errors import InputError, unknown_name
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.studies.comparisons import ends
from selfmodel.studies.rows import KINDS, REFERENCE, frame_of
from selfmodel.studies.statistics import Interval, proportion, ratio
from selfmodel.studies.study import Row, grouped

SINGLE = (1, 2, 3, 5, 6)
"""Numbers of the cases with a single fault."""


def ablation_scores(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Returns the score of each comparator per robot, gap and number of trials, over all cases.

    Returns:
        ``robot``, ``gap``, ``comparator``, ``trials``; ``runs`` and ``right``, numbers of
        diagnoses; ``correct``, their proportion with Wilson's interval; ``time``, the seconds over
        those of ``REFERENCE`` on the same runs; ``recovery``, the score of the best recovery trial
        over that before the failure. The last two are None without such runs.
    """
    groups = grouped(rows, "robot", "gap", "comparator", "trials")
    found = []
    for (robot, gap, comparator, trials), own in sorted(groups.items()):
        reference = {
            (row["truth"], row["seed"]): row["seconds"]
            for row in groups.get((robot, gap, REFERENCE, trials), [])
        }
        times = [
            (row["seconds"], reference[key])
            for row in own
            if (key := (row["truth"], row["seed"])) in reference
        ]
        scores = [
            (row["recovered"], row["before"])
            for row in own
            if None not in (row["recovered"], row["before"]) and row["before"] > 0
        ]
        right = sum(row["correct"] for row in own)
        found.append(
            {
                "robot": robot,
                "gap": gap,
                "comparator": comparator,
                "trials": trials,
                "runs": len(own),
                "right": right,
                "correct": proportion(right, len(own)),
                "time": ratio(*zip(*times, strict=True)) if times else None,
                "recovery": ratio(*zip(*scores, strict=True)) if scores else None,
            }
        )
    return found


def suite_summaries(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Returns the summaries of each body: one per case, then one of all single faults.

    Returns:
        ``robot``; ``case`` and ``truth``, None and "" for all single faults; ``runs`` and
        ``right``, their numbers; ``correct``, the proportion of right diagnoses with Wilson's
        interval; the medians of the scores ``before``, ``after`` and ``recovered``; ``recovery``,
        the median of recovered over before, for runs with a score above 0 before; ``upright``, the
        number of runs whose best recovery trial had no fall; the mean number of ``trials``; the
        median of the ``seconds``.
    """
    found = []
    for (robot,), own in grouped(rows, "robot").items():
        for (case,), same in sorted(grouped(own, "case").items()):
            found.append(_suite_summary(robot, case, same[0]["truth"], same))
        single = [row for row in own if row["case"] in SINGLE]
        if single:
            found.append(_suite_summary(robot, None, "", single))
    return found


def _suite_summary(robot: str, case: int | None, truth: str, rows: Sequence[Row]) -> dict[str, Any]:
    right = sum(row["correct"] for row in rows)
    ratios = [row["recovered"] / row["before"] for row in rows if row["before"] > 0]
    return {
        "robot": robot,
        "case": case,
        "truth": truth,
        "runs": len(rows),
        "right": right,
        "correct": proportion(right, len(rows)),
        **{name: median(row[name] for row in rows) for name in ("before", "after", "recovered")},
        "recovery": median(ratios) if ratios else None,
        "upright": sum(row.get("upright") is True for row in rows),
        "trials": sum(row["trials"] for row in rows) / len(rows),
        "seconds": median(row["seconds"] for row in rows),
    }


def as_json(value: Any) -> Any:  # noqa: ANN401  # JSON
    """Returns rows or summaries as JSON: intervals as objects, unknown numbers as null."""
    if isinstance(value, Interval):
        return as_json(dataclasses.asdict(value))
    if isinstance(value, Mapping):
        return {key: as_json(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Table:
    """A table for programs and for readers.

    Attributes:
        name: Name of its file, without an extension.
        records: The rows with all digits, for programs.
        shown: The same rows as texts, for readers.
        texts: Number of leading columns of ``shown`` that are texts; the others are numbers.
    """

    name: str
    records: pd.DataFrame
    shown: pd.DataFrame
    texts: int


def summary_table(
    name: str, records: Sequence[Row], shown: Sequence[Mapping[str, str]], texts: int
) -> Table:
    """Returns summaries as a table; an interval has three columns, as ``correct_low``.

    Args:
        name: Name of its file, without an extension.
        records: The summaries.
        shown: Their texts for readers, by the title of the column.
        texts: Number of leading columns of texts.
    """
    intervals = {
        key for record in records for key, one in record.items() if isinstance(one, Interval)
    }
    unknown = Interval(math.nan, math.nan, math.nan)
    flat = [
        {
            column: one
            for key, value in record.items()
            for column, one in (
                ends(key, value or unknown) if key in intervals else {key: value}
            ).items()
        }
        for record in records
    ]
    return Table(name, frame_of(flat), pd.DataFrame(shown), texts)


def frame_table(
    name: str,
    records: pd.DataFrame,
    shown: Sequence[Mapping[str, str]] | None = None,
    texts: int = 0,
) -> Table:
    """Returns a frame as a table; without other texts, readers are shown its values.

    Args:
        name: Name of its file, without an extension.
        records: The frame; the names of a table in it become one text.
        shown: Texts for readers, by the title of the column.
        texts: Number of leading columns of texts.
    """
    plain = records.assign(table=records["table"].map(", ".join)) if "table" in records else records
    if shown is None:
        values = plain.astype(object).where(plain.notna(), "-").map(str)
        return Table(name, plain, values, len(plain.columns))
    return Table(name, plain, pd.DataFrame(shown), texts)


def results_files(
    name: str, rows: Sequence[Row], key: str, summaries: Sequence[Row]
) -> dict[str, bytes]:
    """Returns the content of ``results.csv`` and ``results.json`` of a study.

    Args:
        name: Name of the study.
        rows: Its rows.
        key: Name of its summaries in JSON.
        summaries: Its summaries.
    """
    text = json.dumps(as_json({"rows": rows, key: summaries}), indent=1, allow_nan=False)
    table = csv_bytes(frame_of(rows, KINDS[name].columns))
    return {"results.csv": table, "results.json": f"{text}\n".encode()}


def csv_bytes(frame: pd.DataFrame) -> bytes:
    """Returns a frame as CSV (RFC 4180, with newlines as line ends); an unknown value is empty."""
    lower = {True: "true", False: "false"}
    plain = frame.map(lambda value: lower[value] if isinstance(value, bool) else value)
    text: str = plain.to_csv(index=False, lineterminator="\n")
    return text.encode()


def markdown_table(rows: Sequence[Mapping[str, str]], numbers: Sequence[int] = ()) -> str:
    """Returns rows as a Markdown table, aligned left but for the columns of numbers, from 0."""
    rule = ["---:" if place in numbers else "---" for place in range(len(rows[0]))]
    safe = str.maketrans({"\\": "\\\\", "|": "\\|", "\n": " "})
    lines = [
        [text.translate(safe) for text in line] for line in (rows[0], *(r.values() for r in rows))
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in (lines[0], rule, *lines[1:]))


def _markdown(table: Table) -> bytes:
    rows = table.shown.to_dict("records")
    numbers = range(table.texts, len(table.shown.columns))
    return markdown_table(rows, numbers).encode()


def _latex(table: Table) -> bytes:
    count = len(table.shown.columns)
    sides = "".join("l" if place < table.texts else "r" for place in range(count))
    text = table.shown.style.hide(axis="index").format(escape="latex")
    text = text.format_index(escape="latex", axis="columns")
    latex: str = text.to_latex(column_format=sides, hrules=True)
    return latex.encode()


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
        "markdown": ("md", _markdown),
    }
)
"""Suffix and writer by the name of a format. CSV and Parquet files have the records, LaTeX (with
the package booktabs) and Markdown the rows for readers."""


def check_format(wanted: str | None) -> None:
    """Checks, before the work on a table, that it can be written; None is no table.

    Raises:
        InputError: The format is unknown, or needs a package that is missing.
    """
    if wanted is not None:
        one = pd.DataFrame({"n": ["1"]})
        table_files([Table("none", one, one, 0)], wanted)


def table_files(tables: Sequence[Table], wanted: str) -> dict[str, bytes]:
    """Returns the content of the files of tables by their name; a table without a row has none.

    Raises:
        InputError: The format is unknown, or needs a package that is missing.
    """
    if wanted not in FORMATS:
        raise unknown_name("table format", wanted, FORMATS)
    suffix, write = FORMATS[wanted]
    return {f"{table.name}.{suffix}": write(table) for table in tables if len(table.records)}


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
