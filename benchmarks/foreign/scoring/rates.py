"""Tables of the rates of right answers, with 95 % intervals (Wilson's)."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.foreign.cases import CASES, GROUPS
from benchmarks.foreign.scoring.judge import Judgement, judged, matters
from benchmarks.foreign.world.gap import LEVELS
from selfmodel.studies.statistics import proportion

HEADINGS = (
    "recordings",
    "right first",
    "verdict right",
    "false alarms",
    "called intact",
    "invented",
    "severity error",
    "onset found",
    "onset error, s",
    "seconds",
)


def table(rows: Sequence[dict[str, Any]], by: str) -> str:
    """Returns the rates as Markdown, by group or case, and gap.

    Args:
        rows: Rows of the scores. Faults outside all kinds that change the displacement by less
            than a tenth are left out.
        by: ``group`` or ``case``.
    """
    used = [row for row in rows if row["truth"]["group"] != "outside" or matters(row["truth"])]
    names = GROUPS if by == "group" else tuple(CASES)
    lines = [
        f"| {by} | gap | " + " | ".join(HEADINGS) + " |",
        "|---" * (len(HEADINGS) + 2) + "|",
    ]
    for name in names:
        for gap in (*LEVELS, "all"):
            chosen = [
                judged(row)
                for row in used
                if row["truth"][by] == name and gap in (row["truth"]["gap"], "all")
            ]
            if chosen:
                lines.append(f"| {name} | {gap} | " + " | ".join(_cells(chosen)) + " |")
    return "\n".join(lines)


def _cells(judgements: Sequence[Judgement]) -> Iterator[str]:
    yield str(len(judgements))
    for name in ("right", "verdict_right", "false_alarm", "called_intact", "invented"):
        yield _rate([getattr(one, name) for one in judgements])
    yield _median([one.severity_error for one in judgements])
    yield _rate([one.onset_found for one in judgements])
    yield _median([one.onset_error for one in judgements])
    yield _median([one.seconds for one in judgements])


def _rate(values: Sequence[bool | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return ""
    found = proportion(sum(known), len(known))
    return (
        f"{sum(known)}/{len(known)}, {100 * found.estimate:.0f} % "
        f"({100 * found.low:.0f} to {100 * found.high:.0f})"
    )


def _median(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.3g}" if known else ""
