"""Tables of the study: medians and lowest tenths by case, with bootstrap intervals."""

from collections.abc import Iterable, Sequence
from statistics import mean
from typing import Any

import numpy as np

from selfmodel.studies.rows import ORACLE
from selfmodel.studies.statistics import proportion

RESAMPLES = 2000

NOTHING_BREAKS = 9
"""Number of the case of Table I without a failure."""

MIN_SAMPLE = 5
"""Smallest number of values whose median has a bootstrap interval."""

HEADER = """\
| robot | case | gap | n | diagnosis right | before, m | ÷ oracle | first trial ÷ oracle | best ÷ \
oracle | observed ÷ predicted | fell |
|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"""


def table(rows: Sequence[dict[str, Any]], oracles: Sequence[dict[str, Any]]) -> str:
    """Returns a Markdown table, a line per robot, case and gap, and one per robot and gap.

    Rows of several repairs are in lines of their own, with the repair after the robot. A ratio is a
    median, with its 95 % bootstrap interval and the lowest tenth.

    Args:
        rows: Rows of recoveries.
        oracles: Rows of ``benchmarks.rivals``, of which those of the oracle count, each with the
            mean of its trials. The oracle of the healthy robot is that of case 9.
    """
    best = {_cell(row): mean(row["upright"]) for row in oracles if row["method"] == ORACLE}
    lines = [HEADER]
    several = len({row["repair"] for row in rows}) > 1
    for robot, gap, repair in sorted({_group(row) for row in rows}):
        own = [row for row in rows if _group(row) == (robot, gap, repair)]
        name = f"{robot}, {repair}" if several else robot
        lines += [
            _line(name, case, gap, [row for row in own if row["case"] == case], best)
            for case in sorted({row["case"] for row in own})
        ]
        lines.append(_line(name, "all", gap, own, best))
    return "\n".join(lines)


def _group(row: dict[str, Any]) -> tuple[str, float, str]:
    return (row["robot"], row["gap"], row["repair"])


def _line(
    robot: str, case: object, gap: float, rows: Sequence[dict[str, Any]], best: dict[Any, float]
) -> str:
    right = proportion(sum(row["correct"] for row in rows), len(rows))
    # One gait before the failure per seed, whatever the case.
    gaits = {_cell(row, NOTHING_BREAKS): row["upright"][0] for row in rows}
    healthy = [_ratio(before, best.get(cell)) for cell, before in gaits.items()]
    first = [_ratio(row["upright"][2], best.get(_cell(row))) for row in rows]
    largest = [_ratio(max(row["upright"][2:]), best.get(_cell(row))) for row in rows]
    transfer = [
        _ratio(seen, predicted)
        for row in rows
        for seen, predicted in zip(row["upright"][2:], row["predicted"][2:], strict=True)
    ]
    before = mean(gaits.values())
    falls = sum(row["falls"][2 + int(np.argmax(row["upright"][2:]))] is not None for row in rows)
    cells = (
        robot,
        str(case),
        f"{gap:g}",
        str(len(rows)),
        f"{100 * right.estimate:.0f} % ({100 * right.low:.0f} to {100 * right.high:.0f})",
        f"{before:.1f}",
        *(_median(values) for values in (healthy, first, largest, transfer)),
        f"{falls} of {len(rows)}",
    )
    return f"| {' | '.join(cells)} |"


def _cell(row: dict[str, Any], case: int | None = None) -> tuple[Any, ...]:
    return (row["robot"], row["case"] if case is None else case, row["gap"], row["seed"])


def _ratio(value: float, reference: float | None) -> float:
    return value / reference if reference and reference > 0 else float("nan")


def _median(values: Iterable[float]) -> str:
    """Returns the median as text, with its interval and the lowest tenth; "-" without values.

    Fewer than ``MIN_SAMPLE`` values have no interval.
    """
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) < MIN_SAMPLE:
        return f"{np.median(known):.2f} (n {len(known)})" if len(known) else "-"
    rng = np.random.default_rng(0)
    medians = np.median(rng.choice(known, (RESAMPLES, len(known))), axis=1)
    low, high = np.quantile(medians, [0.025, 0.975])
    lowest = np.quantile(known, 0.1)
    return f"{np.median(known):.2f} ({low:.2f} to {high:.2f}; {lowest:.2f})"
