"""Tables of recoveries: rates with Wilson's 95 % intervals, medians with lowest and highest."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel.studies.statistics import proportion

Row = dict[str, Any]

HEADINGS = (
    "recoveries",
    "diagnosis right",
    "before, m",
    "after, m",
    "recovered, m",
    "recovered ÷ before",
    "first trial ÷ before",
    "physical ÷ simulated",
    "upright",
    "seconds",
)


def read_rows(paths: Iterable[Path]) -> list[Row]:
    """Returns the rows of some files, each with a JSON object per line."""
    texts = [path.read_text(encoding="utf-8") for path in paths]
    return [json.loads(line) for text in texts for line in text.splitlines() if line.strip()]


def table(rows: Sequence[Row]) -> str:
    """Returns the rows as Markdown, by robot and case.

    A recovery that ended with an error counts as a wrong diagnosis, and as a recovery of 0 m that
    is not upright. One whose healthy robot went backwards has no ratio to the displacement before.
    """
    lines = [
        "| robot | case | " + " | ".join(HEADINGS) + " |",
        "|---" * (len(HEADINGS) + 2) + "|",
    ]
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        groups = {str(case): [row for row in own if row["case"] == case] for case in _cases(own)}
        for case, chosen in [*groups.items(), ("all", own)]:
            lines.append(f"| {robot} | {case} | " + " | ".join(_cells(chosen)) + " |")
    return "\n".join(lines)


def _cases(rows: Sequence[Row]) -> list[int]:
    return sorted({row["case"] for row in rows})


def _cells(rows: Sequence[Row]) -> list[str]:
    complete = [row for row in rows if "error" not in row]
    forward = [row for row in complete if row["before"] > 0]
    errors = [0.0] * (len(rows) - len(complete))
    trials = [trial for row in complete for trial in _recovery_trials(row)]
    ratios = [trial["displacement"] / trial["simulated"] for trial in trials if trial["simulated"]]
    upright = [_best(row)["upright"] for row in complete]
    return [
        str(len(rows)),
        _rate([row.get("correct", False) for row in rows]),
        *(_median([row[key] for row in complete]) for key in ("before", "after", "recovered")),
        _median([row["recovered"] / row["before"] for row in forward] + errors),
        _median([_first(row)["displacement"] / row["before"] for row in forward] + errors),
        _median(ratios),
        _rate(upright + [False] * len(errors)),
        _median([row["seconds"] for row in rows]),
    ]


def _first(row: Row) -> Row:
    return _recovery_trials(row)[0]


def _best(row: Row) -> Row:
    return max(_recovery_trials(row), key=lambda trial: trial["displacement"])


def _recovery_trials(row: Row) -> list[Row]:
    return [trial for trial in row["trials"] if trial["stage"] == "recovery"]


def _rate(values: Sequence[bool]) -> str:
    found = proportion(sum(values), len(values))
    return (
        f"{sum(values)}/{len(values)}, {100 * found.estimate:.0f} % "
        f"({100 * found.low:.0f} to {100 * found.high:.0f})"
    )


def _median(values: Sequence[float]) -> str:
    if not values:
        return ""
    return f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"
