"""The rows of an ablation: one a diagnosis."""

import csv
import dataclasses
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """One diagnosis, and whether it is right. What is None was not determined.

    Attributes:
        robot: The robot.
        case: Which failure of Table I, if it is one.
        truth: What it is, in notation.
        gap: The level of the reality gap.
        seed: The seed of the run.
        next_trial: How the trials' controllers were chosen.
        comparator: As it was asked for.
        trials: Trials of the damaged robot that the diagnosis explains.
        best: The hypothesis ranked first, in notation.
        correct: Whether it is the truth, or cannot be told from it by these trials.
        distance: Of the best hypothesis, in the comparator's unit.
        intact_distance: Of "nothing changed".
        verdict: What the diagnosis says of itself.
        rivals: How many other hypotheses it cannot tell from the best, ten at most.
        evaluations: Hypotheses that were asked about since the first trial.
        distinct_hypotheses: How many of those differ.
        seconds: Wall time of the diagnoses since the first trial, on one thread.
        before: Forward displacement before the failure, m.
        after: Forward displacement with the same controller after it, m.
        recovered: Forward displacement of the best recovery trial so far, m.
    """

    robot: str
    case: int | None
    truth: str
    gap: float
    seed: int
    next_trial: str
    comparator: str
    trials: int
    best: str
    correct: bool
    distance: float | None
    intact_distance: float | None
    verdict: str | None
    rivals: int | None
    evaluations: int | None
    distinct_hypotheses: int | None
    seconds: float
    before: float | None
    after: float | None
    recovered: float | None

    @property
    def run(self) -> tuple[str, str, float, int]:
        """What is the same for all comparators: robot, truth, gap, seed."""
        return self.robot, self.truth, self.gap, self.seed

    @property
    def failure(self) -> str:
        """What the failure is called: its number in Table I, or its notation."""
        return self.truth if self.case is None else f"{self.case:2d}"


COLUMNS = tuple(field.name for field in dataclasses.fields(Row))


def as_csv(rows: Sequence[Row]) -> str:
    """Returns rows as CSV (RFC 4180, but lines end in a newline); None is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        writer.writerow(_cell(getattr(row, column)) for column in COLUMNS)
    return text.getvalue()


def as_objects(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Returns rows as JSON has them."""
    return [dataclasses.asdict(row) for row in rows]


def _cell(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else value
