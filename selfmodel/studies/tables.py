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
from selfmodel.errors import InputError, check_name, typed
from selfmodel.files import path_of
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.plugins import RETURN
from selfmodel.studies import figures
from selfmodel.studies.comparisons import balance_warnings, ends
from selfmodel.studies.recoveries import ENDS, RULE
from selfmodel.studies.rows import (
    KINDS,
    MEASURED_AT_ENDS,
    REFERENCE,
    UPRIGHT_AT_ENDS,
    ablation_notes,
    frame_of,
    methods_of,
    outcomes_of,
    outcomes_text,
    study_rows,
    whole,
)
from selfmodel.studies.statistics import UNKNOWN, Interval, proportion, ratio
from selfmodel.studies.study import Row, grouped
from selfmodel.style import figure_style
from selfmodel.tasks.suite_bodies import DOMAINS, EPISODE, PREFIX

TRIAL_COLUMNS = (
    *("robot", "case", "truth", "seed", "number", "stage", "hypothesis", "score", "predicted"),
    *("robust_mean", "displacement", "return", "fell_at_step"),
)
"""Columns of the trials of a study of bodies."""

SINGLE = (1, 2, 3, 5, 6)
"""Numbers of the cases with a single fault."""


def ablation_scores(rows: Sequence[Row]) -> list[Row]:
    """Returns the score of each method per robot, gap and number of trials, over all cases.

    Returns:
        ``robot``, ``gap``, ``comparator``, ``method``, ``trials``; ``runs`` and ``right``, numbers
        of diagnoses; ``correct``, their proportion with Wilson's interval; ``time``, the seconds
        over those of ``REFERENCE`` on the same runs; ``recovery``, the score of the best recovery
        trial over that before the failure; ``simulated_steps``, the median of the control steps
        that the diagnoses simulated. The last three are None without such runs.
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
        steps = [row["simulated_steps"] for row in own if row.get("simulated_steps")]
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
                "simulated_steps": median(steps) if steps else None,
            }
        )
    return scores


def suite_summaries(rows: Sequence[Row]) -> list[Row]:
    """Returns the summaries of each body: one per failure, then one of its single faults, if many.

    Returns:
        ``robot``; ``case`` and ``truth``, None and "" for all single faults of Table I; ``runs``
        and ``right``, their numbers; ``correct``, the proportion of right diagnoses with Wilson's
        interval; ``score``, its ``unit``, and the ``control_steps``; the medians of ``before``,
        ``after`` and ``best_trial``, of the displacements and returns with these ends, and
        ``return_most``; the median of ``regained`` and the number of each of the ``outcomes``, see
        ``recoveries.outcome_of``; ``upright`` with these ends, the number of runs without a fall in
        that trial, None if that is unknown; the mean number of ``trials``; the medians of the
        ``simulated_steps`` and the ``seconds``; ``reason``, why the body cannot have the failure.
    """
    summaries = []
    for (robot,), own in grouped(rows, "robot").items():
        failures = [(*key, same) for key, same in grouped(own, "case", "truth").items()]
        every = [row for row in own if row["case"] in SINGLE and not row.get("reason")]
        if len({row["case"] for row in every}) > 1:
            failures.append((None, "", every))
        summaries += [
            {"robot": robot, "case": case, "truth": truth, **_summary(same)}
            for case, truth, same in failures
        ]
    return summaries


def _summary(rows: Sequence[Row]) -> Row:
    runs, first = [row for row in rows if not row.get("reason")], rows[0]
    up = {end: [row[end] for row in runs if row.get(end) is not None] for end in UPRIGHT_AT_ENDS}
    return {
        **_right(runs),
        **{name: first.get(name) for name in ("score", "unit", "control_steps")},
        **medians(runs, *ENDS, "regained"),
        "outcomes": outcomes_text(runs),
        **{name: sum(stayed) if stayed else None for name, stayed in up.items()},
        **medians(runs, *MEASURED_AT_ENDS),
        "return_most": first.get("return_most"),
        "trials": fmean(row["trials"] for row in runs) if runs else None,
        **medians(runs, "simulated_steps", "seconds"),
        "reason": first.get("reason"),
    }


def _right(rows: Sequence[Row]) -> Row:
    right = sum(row["correct"] for row in rows)
    share = proportion(right, len(rows)) if rows else None
    return {"runs": len(rows), "right": right, "correct": share}


def medians(rows: Sequence[Row], *names: str) -> Row:
    """Returns the medians of some columns, of the known values; None without any."""
    known = {name: [row[name] for row in rows if row.get(name) is not None] for name in names}
    return {name: median(values) if values else None for name, values in known.items()}


@dataclass(frozen=True)
class Table:
    """A table, whose file has its name: the rows with all digits, and as texts for readers.

    The first columns for readers, ``texts`` of them, are texts, the others numbers. ``note`` says
    what the columns are.
    """

    name: str
    records: pd.DataFrame
    shown: pd.DataFrame
    texts: int
    note: str = ""


def table_of(
    name: str,
    records: pd.DataFrame | Sequence[Row],
    shown: Sequence[Mapping[str, str]] | None = None,
    texts: int = 0,
    note: str = "",
) -> Table:
    """Returns rows as a table.

    Args:
        name: Name of its file, without an extension.
        records: The rows; an interval becomes three columns, as ``correct_low``, and the names of a
            table in a frame one text.
        shown: Their texts for readers, by the title of the column; None for the values themselves.
        texts: Number of leading columns of texts.
        note: What the columns are.
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
    return Table(name, frame, pd.DataFrame(shown), texts, note)


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


def ablation_results(folder: str | Path, style: str | Path | None = None) -> Results:
    """Returns the results of an ablation, with its figures in a style; see ``figure_style``."""
    folder = path_of(folder, "the folder of a study")
    rows = study_rows("ablate", folder)
    scores = ablation_scores(rows)
    counts = {one["trials"] for one in scores}
    shown = [one for one in scores if one["trials"] in (min(counts), max(counts))]
    with figure_style(style):
        drawn = figures.of_ablation(rows, scores)
    warnings = balance_warnings(whole(outcomes_of("ablate", rows)))
    facts = {"rows": rows, "scores": scores}
    legend = " ".join(ablation_notes(rows, folder))
    return Results(
        facts,
        [_score_table(scores, legend)],
        _score_table(shown),
        legend,
        _files("ablate", facts) | {f"figures/{name}": data for name, data in drawn.items()},
        [f"warning: {warning}" for warning in warnings],
    )


def suite_results(folder: Path) -> Results:
    """Returns the results of a study of bodies, with a figure."""
    rows, trials = study_rows("suite", folder), study_rows("suite", folder, "trials")
    summaries = suite_summaries(rows)
    facts = {"rows": rows, "summaries": summaries, "trials": trials}
    table, shown = (
        table_of("summaries", some, [_summary_text(one, some) for one in some], texts=2)
        for some in (summaries, [one for one in summaries if one["runs"]])
    )
    files = _files("suite", facts) | {"trials.csv": csv_bytes(frame_of(trials, TRIAL_COLUMNS))}
    files |= {f"figures/{name}": data for name, data in figures.of_suite(rows).items()}
    return Results(facts, [table], shown, _legend(summaries), files)


def _legend(summaries: Sequence[Row]) -> str:
    """Returns what the values in the table of a study of bodies are, and what is not in it."""
    lines = []
    for one in summaries:
        if one["reason"]:
            failure = one["truth"] or f"case {one['case']}"
            lines.append(f"Not run: {one['robot']}, {failure}: {one['reason']}")
    ran = [one for one in summaries if one["runs"] and one["truth"]]  # not those of several faults
    if not ran:
        return "\n".join(lines)
    text = (
        f"The score is {ran[0]['score']}, of trials of {ran[0]['control_steps']} control steps: "
        f"medians before and after the failure, and in the best trial since. {RULE} Otherwise, "
        f"loss regained is (best trial - after) / (before - after). "
    )
    if most := next((one["return_most"] for one in ran if one["return_most"]), None):
        which = "as these trials" if most == EPISODE else f"of which these trials have {most:,}"
        text += f"An episode of dm_control has {EPISODE:,} rewards of up to 1, {which}. "
    fell = []
    for (robot,), own in grouped(ran, "robot").items():
        if own[0]["return_before"] is not None and not own[0]["return_most"]:
            text += f"The rewards of {robot} are speeds, m/s, whose sum has no largest value. "
        if robot in DOMAINS:
            text += f"{robot} is selfmodel's own robot; that of dm_control is {PREFIX}{robot}. "
        stood = [(one["upright_before"], one["runs"]) for one in own]
        if falls := sum(runs - up for up, runs in stood if up is not None):
            fell.append(f"{falls} of {sum(runs for _, runs in stood)} runs of {robot}")
    if fell:
        text += f"The gait before the failure fell in {', '.join(fell)}: a larger budget "
        text += "(--repair-generations) or another --controller may keep it up. "
    return "\n".join([f"{text}Right has its 95 % interval, %.", *lines])


def _files(name: str, facts: Mapping[str, Any]) -> dict[str, bytes]:
    return {
        "results.csv": csv_bytes(frame_of(facts["rows"], KINDS[name].columns)),
        "results.json": json_bytes(facts),
    }


def _score_table(scores: Sequence[Row], note: str = "") -> Table:
    has_recovery = any(one["recovery"] for one in scores)
    has_steps = any(one["simulated_steps"] for one in scores)
    texts = [
        {
            "robot": one["robot"],
            "gap": f"{one['gap']:g}",
            "method": one["method"],
            "trials": str(one["trials"]),
            "right": f"{one['right']} of {one['runs']}",
            "right, %": _interval(one["correct"], 100, ".0f"),
            "time": _interval(one["time"]),
            **({"simulated steps": f"{one['simulated_steps'] or 0:,.0f}"} if has_steps else {}),
            **({"recovered ÷ before": _interval(one["recovery"])} if has_recovery else {}),
        }
        for one in scores
    ]
    return table_of("scores", scores, texts, 3, note)


def _summary_text(one: Row, every: Sequence[Row]) -> dict[str, str]:
    """Returns the texts of a summary; its columns are those that any of them has."""
    score, unit = next(((it["score"], it["unit"]) for it in every if it["score"]), ("", ""))
    runs, share, most = one["runs"], one["correct"], one["return_most"]
    interval = f" ({100 * share.low:.0f} to {100 * share.high:.0f})" if share else ""
    case = "" if one["case"] is None else f"{one['case']}, "
    texts = {
        "robot": one["robot"],
        "failure": f"{case}{one['truth']}".rstrip(", ") or "single faults",
        "right": f"{one['right']} of {runs}{interval}" if runs else "-",
    }
    for end in ENDS:
        limit = f" of {most:,}" if runs and most and score == RETURN else ""
        title = f"{score} {end.replace('_', ' ')}, {unit}".strip(", ")
        texts[title] = _number(one[end]) + limit
    texts["loss regained, %"] = _number(one["regained"] and 100 * one["regained"], ".0f")
    texts["outcome"] = one["outcomes"] or "-"
    stayed = ", ".join(_number(one[f"upright_{end}"], "d") for end in ENDS)
    texts["upright"] = f"{stayed} of {runs}" if runs else "-"
    for what, title in (("displacement", "displacements, m"), (RETURN, "returns")):
        if what != score and any(it[f"{what}_before"] is not None for it in every):
            values = ", ".join(_number(one[f"{what}_{end}"]) for end in ENDS) if runs else "-"
            texts[title] = f"{values} of {most:,}" if runs and most and what == RETURN else values
    if any(it["simulated_steps"] for it in every):
        steps = one["simulated_steps"]
        texts["simulated steps"] = "-" if steps is None else f"{steps:,.0f}"
    return texts | ({"why not": one["reason"] or ""} if any(it["reason"] for it in every) else {})


def _number(value: float | None, form: str = ".3f") -> str:
    return "-" if value is None else format(value, form)


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
    text = "".join(f"| {' | '.join(line)} |\n" for line in (lines[0], rule, *lines[1:]))
    return f"{text}\n{table.note}\n" if table.note else text


def _latex(table: Table) -> bytes:
    sides = "l" * table.texts + "r" * (len(table.shown.columns) - table.texts)
    text = table.shown.style.hide(axis="index").format(_mathematical, escape="latex")
    text = text.format_index(escape="latex", axis="columns")
    latex: str = text.to_latex(column_format=sides, hrules=True)
    if table.note:
        note = _mathematical(re.sub(r"[%&#_$]", r"\\\g<0>", table.note))
        latex += f"\\par\\smallskip{{\\footnotesize {note}\\par}}\n"
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


def check_format(wanted: str | None) -> None:
    """Checks, before the work on a table, that it can be written; None is no table."""
    if wanted is not None:
        table_files([table_of("none", [{"n": "1"}])], wanted)


def table_files(tables: Sequence[Table], wanted: str) -> dict[str, bytes]:
    """Returns the content of the files of tables by their name; a table without a row has none."""
    check_name("table format", wanted, FORMATS)
    suffix, write = FORMATS[wanted]
    return {f"{table.name}.{suffix}": write(table) for table in tables if len(table.records)}


@typed
def write_files(folder: str | Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Writes files, by their path in a folder, which is made if missing; returns their paths."""
    folder = path_of(folder, "the folder of a study")
    for name, data in files.items():
        make_folder((folder / name).parent, folder)
        replace_file(folder / name, data)
    return tuple(folder / name for name in files)
