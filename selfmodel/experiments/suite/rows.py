"""Rows of a study of many bodies, one per recovery, and their summaries by body and case."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from selfmodel.experiments.confidence_intervals import Interval, proportion
from selfmodel.plugins import OWN_SEARCH, PAPER

SINGLE = (1, 2, 3, 5, 6)
"""Numbers of the cases with a single fault."""


@dataclass(frozen=True)
class SuiteRow:
    """One recovery with its truth and its cost.

    Attributes:
        robot: Name of the body.
        case: Number of the failure.
        truth: The failure, in notation.
        seed: Seed of the run.
        best: Best hypothesis of the last diagnosis, in notation.
        correct: Whether the best hypothesis is the truth, or behaves like the truth in all trials.
        verdict: Verdict of the last diagnosis.
        trials: Number of physical trials since the failure.
        before: Score of the trial before the failure.
        after: Score of the same controller after the failure.
        recovered: Score of the best recovery trial.
        diverged: Number of diverged simulations.
        seconds: Wall time of the recovery without the evolution of its first gait, on one thread.
        upright: Whether the robot did not fall in the best recovery trial; None in a row of a
            version that did not record it.
        repair: Name of the repair; versions that did not record it had the paper's alone.
        search: Name of the search of the repair.
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
    upright: bool | None = None
    repair: str = PAPER
    search: str = OWN_SEARCH[PAPER]


@dataclass(frozen=True)
class Summary:
    """Summary of the runs of a body, over the seeds of one case or over all single faults.

    Attributes:
        robot: Name of the body.
        case: Number of the case; None for all single faults.
        truth: The failure, in notation; "" for all single faults.
        runs: Number of runs.
        right: Number of right diagnoses.
        correct: Proportion of right diagnoses, with Wilson's interval.
        before: Median score before the failure.
        after: Median score after the failure.
        recovered: Median score of the best recovery trial.
        recovery: Median of recovered over before for runs with before above 0; None without any.
        upright: Number of runs whose best recovery trial had no fall.
        trials: Mean number of physical trials since the failure.
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
    upright: int
    trials: float
    seconds: float


def summarise(rows: Sequence[SuiteRow]) -> tuple[Summary, ...]:
    """Returns the summaries of each body: one per case, then one of all single faults."""
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


def _summary(robot: str, case: int | None, truth: str, rows: Sequence[SuiteRow]) -> Summary:
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
        upright=sum(row.upright is True for row in rows),
        trials=sum(row.trials for row in rows) / len(rows),
        seconds=median(row.seconds for row in rows),
    )
