"""Scores of the comparators: proportion of right diagnoses and cost, with 95 % intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.experiments.ablation.rows import AblationRow
from selfmodel.experiments.confidence_intervals import Interval, proportion, ratio

REFERENCE = FORWARD_DISPLACEMENT.name
"""The comparator whose time is 1: the paper's."""


@dataclass(frozen=True)
class ComparatorScore:
    """Score of a comparator on one robot at one gap after a number of trials, over all cases.

    Attributes:
        robot: Name of the robot.
        gap: Level of the reality gap.
        comparator: Name of the comparator.
        trials: Number of trials that each diagnosis explains.
        runs: Number of diagnoses.
        right: Number of right diagnoses.
        correct: Proportion of right diagnoses, with Wilson's interval.
        time: Seconds over those of ``REFERENCE`` on the same runs; None without such runs.
        recovery: Displacement of the best recovery trial over the displacement before the failure;
            None if no run has both.
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


def summarise(rows: Sequence[AblationRow]) -> tuple[ComparatorScore, ...]:
    """Returns the score of each comparator per robot, gap and number of trials."""
    groups: dict[tuple[str, float, str, int], list[AblationRow]] = {}
    for row in rows:
        groups.setdefault((row.robot, row.gap, row.comparator, row.trials), []).append(row)
    scores = []
    for (robot, gap, comparator, trials), same in sorted(groups.items()):
        reference = {row.run: row for row in groups.get((robot, gap, REFERENCE, trials), [])}
        paired = [(row, reference[row.run]) for row in same if row.run in reference]
        right = sum(row.correct for row in same)
        scores.append(
            ComparatorScore(
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


def _recovery(rows: Sequence[AblationRow]) -> Interval | None:
    displacements = [
        (row.recovered, row.before)
        for row in rows
        if row.recovered is not None and row.before is not None and row.before > 0
    ]
    if not displacements:
        return None
    return ratio([after for after, _ in displacements], [before for _, before in displacements])
