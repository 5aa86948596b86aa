"""The rows of a study, one a run, and what they amount to for each body and case."""

import csv
import dataclasses
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from selfmodel.experiments.confidence_intervals import Interval, proportion

SINGLE = (1, 2, 3, 5, 6)
"""The cases that are one fault."""


@dataclass(frozen=True)
class Row:
    """One recovery.

    Attributes:
        robot: The body.
        case: Which failure it is.
        truth: What it is, in notation.
        seed: The seed of the run.
        best: The last diagnosis, in notation.
        correct: Whether it is the truth, or cannot be told from it by the trials.
        verdict: What the diagnosis says of itself.
        trials: Physical trials since the failure.
        before: Score of the trial before the failure.
        after: Score of the same controller after it.
        recovered: Score of the best recovery trial.
        diverged: Simulations that broke down.
        seconds: Wall time of the recovery without the gait before it, on one thread.
    """

    robot: str
    case: int
    truth: str
    seed: int
    best: str
    correct: bool
    verdict: str
    trials: int
    before: float
    after: float
    recovered: float
    diverged: int
    seconds: float


@dataclass(frozen=True)
class Summary:
    """What the runs of a body come to, over the seeds of one case or over its single faults.

    Attributes:
        robot: The body.
        case: The case; None for all single faults.
        truth: What it is, in notation; "" for all single faults.
        runs: How many runs.
        right: How many of their diagnoses are right.
        correct: The proportion, with Wilson's interval.
        before: Median score before the failure.
        after: Median score after it.
        recovered: Median score of the best recovery trial.
        recovery: Median of recovered over before, where that is above 0; None where it never is.
        trials: Mean of the physical trials since the failure.
        seconds: Median wall time.
    """

    robot: str
    case: int | None
    truth: str
    runs: int
    right: int
    correct: Interval
    before: float
    after: float
    recovered: float
    recovery: float | None
    trials: float
    seconds: float


def summarise(rows: Sequence[Row]) -> tuple[Summary, ...]:
    """Returns a summary for each case of each body, and after them one of its single faults."""
    found = []
    for robot in dict.fromkeys(row.robot for row in rows):
        own = [row for row in rows if row.robot == robot]
        for case in sorted({row.case for row in own}):
            same = [row for row in own if row.case == case]
            found.append(_summary(robot, case, same[0].truth, same))
        single = [row for row in own if row.case in SINGLE]
        if single:
            found.append(_summary(robot, None, "", single))
    return tuple(found)


def _summary(robot: str, case: int | None, truth: str, rows: Sequence[Row]) -> Summary:
    right = sum(row.correct for row in rows)
    ratios = [row.recovered / row.before for row in rows if row.before > 0]
    return Summary(
        robot=robot,
        case=case,
        truth=truth,
        runs=len(rows),
        right=right,
        correct=proportion(right, len(rows)),
        before=median(row.before for row in rows),
        after=median(row.after for row in rows),
        recovered=median(row.recovered for row in rows),
        recovery=median(ratios) if ratios else None,
        trials=sum(row.trials for row in rows) / len(rows),
        seconds=median(row.seconds for row in rows),
    )


def as_csv(rows: Sequence[Row]) -> str:
    """Returns rows as CSV (RFC 4180, but lines end in a newline)."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [field.name for field in dataclasses.fields(Row)]
    writer.writerow(columns)
    for row in rows:
        values = (getattr(row, column) for column in columns)
        writer.writerow(str(v).lower() if isinstance(v, bool) else v for v in values)
    return text.getvalue()


def as_objects(rows: Iterable[Row | Summary]) -> list[dict[str, Any]]:
    """Returns rows as JSON has them."""
    return [dataclasses.asdict(row) for row in rows]
