"""How often each comparator is right, and at what cost, with 95 % intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.experiments.ablation.rows import Row
from selfmodel.experiments.confidence_intervals import Interval, proportion, ratio

REFERENCE = FORWARD_DISPLACEMENT.name
"""The comparator whose time is 1: the paper's."""


@dataclass(frozen=True)
class Score:
    """How well a comparator did on one robot, at one gap, after so many trials, over all cases.

    Attributes:
        robot: The robot.
        gap: The level of the reality gap.
        comparator: The comparator.
        trials: Trials that each diagnosis explains.
        runs: How many diagnoses.
        right: How many of them are right.
        correct: The proportion, with Wilson's interval.
        time: Seconds over those of ``REFERENCE`` on the same runs; None without those.
        recovery: Displacement of the best recovery trial over that before the failure; None where
            no run has both.
    """

    robot: str
    gap: float
    comparator: str
    trials: int
    runs: int
    right: int
    correct: Interval
    time: Interval | None
    recovery: Interval | None


def summarise(rows: Sequence[Row]) -> tuple[Score, ...]:
    """Returns the score of each comparator, for each robot, gap and number of trials."""
    groups: dict[tuple[str, float, str, int], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.robot, row.gap, row.comparator, row.trials), []).append(row)
    scores = []
    for (robot, gap, comparator, trials), same in sorted(groups.items()):
        reference = {row.run: row for row in groups.get((robot, gap, REFERENCE, trials), [])}
        paired = [(row, reference[row.run]) for row in same if row.run in reference]
        right = sum(row.correct for row in same)
        scores.append(
            Score(
                robot=robot,
                gap=gap,
                comparator=comparator,
                trials=trials,
                runs=len(same),
                right=right,
                correct=proportion(right, len(same)),
                time=ratio([own.seconds for own, _ in paired], [ref.seconds for _, ref in paired])
                if paired
                else None,
                recovery=_recovery(same),
            )
        )
    return tuple(scores)


def _recovery(rows: Sequence[Row]) -> Interval | None:
    ways = [
        (row.recovered, row.before)
        for row in rows
        if row.recovered is not None and row.before is not None and row.before > 0
    ]
    return ratio([after for after, _ in ways], [before for _, before in ways]) if ways else None
