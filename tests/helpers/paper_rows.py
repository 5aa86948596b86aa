"""Rows of the paper's experiment, made up."""

from collections.abc import Sequence

from selfmodel.experiments.paper.rows import EvolutionRow, RecoveryRow, TrialRow


def recovery(
    *,
    robot: str = "quadruped",
    case: int = 1,
    seed: int = 0,
    comparator: str = "a",
    before: float = 2.0,
    recovered: float = 2.0,
    correct: bool = True,
) -> RecoveryRow:
    """A recovery; its best hypothesis is the truth, or ``intact`` if it is wrong."""
    truth = "break:front_left_knee"
    return RecoveryRow(
        robot=robot,
        case=case,
        truth=truth,
        seed=seed,
        comparator=comparator,
        compared_by=comparator,
        best=truth if correct else "intact",
        correct=correct,
        before=before,
        after=0.5,
        recovered=recovered,
        distinct_hypotheses=50,
        diverged=0,
        seconds=3.0,
    )


def trials(
    displacements: Sequence[float],
    *,
    robot: str = "quadruped",
    case: int = 1,
    seed: int = 0,
    comparator: str = "a",
) -> list[TrialRow]:
    """The trials of one recovery: before, after, then those of the recovery."""
    stages = ["before", "after", *["recovery"] * (len(displacements) - 2)]
    return [
        TrialRow(robot, case, seed, comparator, number, stage, "intact", displacement)
        for number, (stage, displacement) in enumerate(zip(stages, displacements, strict=True))
    ]


def evolution(
    bests: Sequence[float], *, robot: str = "quadruped", case: int = 1, seed: int = 0
) -> list[EvolutionRow]:
    """An evolution on the robot, 10 evaluations a generation; 2 m before the failure."""
    return [
        EvolutionRow(robot, case, seed, evaluations=10 * number, before=2.0, best=best)
        for number, best in enumerate(bests, start=1)
    ]
