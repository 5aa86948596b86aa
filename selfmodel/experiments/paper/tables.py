"""Tables of the paper's experiment: failures, recoveries by case, cost by way of recovery."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.paper.reported import FAILURES, is_restored
from selfmodel.experiments.paper.rows import (
    EvolutionRow,
    RecoveryRow,
    Run,
    TrialRow,
    best_so_far,
    ratio,
    run_of,
)

RESTORED_FROM = 0.8
"""Share of the displacement before the failure from which a function counts as restored here."""


@dataclass(frozen=True)
class Failure:
    """Row of Table I.

    Attributes:
        case: Number of the failure.
        failure: What fails, as in the paper.
        robot: Name of the robot.
        truth: The failure, in notation.
    """

    case: int
    failure: str
    robot: str
    truth: str


@dataclass(frozen=True)
class CaseSummary:
    """Row of Table II: the runs of one case with one comparator.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure.
        truth: The failure, in notation.
        comparator: Name of the comparator as requested.
        runs: Number of runs.
        right: Number of right diagnoses after all trials.
        before: Median displacement before the failure, m.
        after: Median displacement of the same controller after the failure, m.
        recovered: Median displacement of the best recovery trial, m.
        recovery: Median of recovered over before, over the runs that walked forward; None without
            any of them.
        lowest: Smallest of these ratios.
        highest: Largest of these ratios.
        restored: Number of runs with a ratio of at least ``RESTORED_FROM``.
        restored_in_paper: Whether the paper reports the function as restored.
        best: Best hypotheses of the wrong diagnoses, in notation, separated by spaces.
        distinct_hypotheses: Median number of distinct hypotheses that were simulated.
        diverged: Number of diverged simulations.
        seconds: Median wall time.
    """

    robot: str
    case: int
    truth: str
    comparator: str
    runs: int
    right: int
    before: float
    after: float
    recovered: float
    recovery: float | None
    lowest: float | None
    highest: float | None
    restored: int
    restored_in_paper: bool
    best: str
    distinct_hypotheses: float
    diverged: int
    seconds: float


@dataclass(frozen=True)
class Cost:
    """Function that was restored with a number of physical trials, over the runs of a robot.

    Attributes:
        robot: Name of the robot.
        way: Name of the comparator as requested, or of the evolution on the robot.
        physical_trials: Physical trials after the failing one.
        runs: Number of runs.
        low: First quartile of the displacement over that before the failure.
        recovery: Median.
        high: Third quartile.
    """

    robot: str
    way: str
    physical_trials: int
    runs: int
    low: float
    recovery: float
    high: float


def failures(rows: Sequence[RecoveryRow]) -> tuple[Failure, ...]:
    """Returns Table I for the robots and cases of the rows."""
    found = {(row.case, row.robot): row.truth for row in rows}
    return tuple(
        Failure(case, FAILURES[case], robot, truth)
        for (case, robot), truth in sorted(found.items(), key=lambda item: item[0][0])
    )


def summaries(rows: Sequence[RecoveryRow]) -> tuple[CaseSummary, ...]:
    """Returns Table II: a row per robot, case and comparator, in the order of the rows."""
    groups: dict[tuple[str, int, str], list[RecoveryRow]] = {}
    for row in rows:
        groups.setdefault((row.robot, row.case, row.comparator), []).append(row)
    return tuple(_summary(group) for group in groups.values())


def _summary(rows: Sequence[RecoveryRow]) -> CaseSummary:
    first = rows[0]
    ratios = [row.ratio for row in rows if not math.isnan(row.ratio)]
    return CaseSummary(
        robot=first.robot,
        case=first.case,
        truth=first.truth,
        comparator=first.comparator,
        runs=len(rows),
        right=sum(row.correct for row in rows),
        before=median(row.before for row in rows),
        after=median(row.after for row in rows),
        recovered=median(row.recovered for row in rows),
        recovery=median(ratios) if ratios else None,
        lowest=min(ratios, default=None),
        highest=max(ratios, default=None),
        restored=sum(value >= RESTORED_FROM for value in ratios),
        restored_in_paper=is_restored(first.robot, first.case),
        best=" ".join(sorted({row.best for row in rows if not row.correct})),
        distinct_hypotheses=median(row.distinct_hypotheses for row in rows),
        diverged=sum(row.diverged for row in rows),
        seconds=median(row.seconds for row in rows),
    )


def costs(trials: Sequence[TrialRow], evolution: Sequence[EvolutionRow]) -> tuple[Cost, ...]:
    """Returns the restored function by way and number of physical trials.

    Only runs that all ways of a robot have count, so that the ways are paired, and only those with
    a displacement above 0 before the failure.

    Args:
        trials: Physical trials of all recoveries, those of one recovery in order.
        evolution: Generations of the evolutions on the robot.
    """
    ways: dict[tuple[str, str], dict[Run, list[tuple[int, float]]]] = {}
    for recovery in recoveries(trials):
        first = recovery[0]
        steps = list(enumerate(best_so_far(recovery)))[1:]
        ways.setdefault((first.robot, first.comparator), {})[run_of(first)] = steps
    for row in evolution:
        runs = ways.setdefault((row.robot, ON_ROBOT), {})
        runs.setdefault(run_of(row), []).append((row.evaluations, ratio(row.best, row.before)))
    found = []
    for (robot, way), runs in ways.items():
        others = [other for (name, _), other in ways.items() if name == robot]
        values: dict[int, list[float]] = {}
        for run in runs:
            for count, value in runs[run] if all(run in other for other in others) else ():
                if not math.isnan(value):
                    values.setdefault(count, []).append(value)
        found += [_cost(robot, way, count, known) for count, known in values.items()]
    return tuple(found)


def _cost(robot: str, way: str, count: int, values: Sequence[float]) -> Cost:
    low, middle, high = map(float, np.quantile(values, (0.25, 0.5, 0.75)))
    return Cost(robot, way, count, len(values), low, middle, high)


def last_costs(found: Sequence[Cost]) -> tuple[Cost, ...]:
    """Returns the costs with the most physical trials, one per robot and way."""
    last: dict[tuple[str, str], Cost] = {}
    for cost in found:
        known = last.setdefault((cost.robot, cost.way), cost)
        if cost.physical_trials > known.physical_trials:
            last[cost.robot, cost.way] = cost
    return tuple(last.values())


def recoveries(trials: Sequence[TrialRow]) -> list[list[TrialRow]]:
    """Returns the trials of each recovery."""
    groups: dict[tuple[Run, str], list[TrialRow]] = {}
    for trial in trials:
        groups.setdefault((run_of(trial), trial.comparator), []).append(trial)
    return list(groups.values())
