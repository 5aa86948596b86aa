"""Rows of the paper's experiment: recoveries, their physical trials, evolution on the robot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from selfmodel.studies.experiment import Experiment, Outcome


@dataclass(frozen=True)
class RecoveryRow:
    """One recovery with its truth and its cost.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I.
        truth: The failure, in notation.
        seed: Seed of the run.
        comparator: Name of the comparator as requested, ``auto`` included.
        compared_by: Name of the comparator that was chosen.
        best: Best hypothesis of the last diagnosis, in notation.
        correct: Whether the best hypothesis is the truth, or behaves like the truth in all trials.
        before: Forward displacement before the failure, m.
        after: Forward displacement of the same controller after the failure, m.
        recovered: Largest forward displacement of the recovery trials, m.
        distinct_hypotheses: Number of distinct hypotheses that were simulated.
        diverged: Number of diverged simulations.
        seconds: Wall time of the recovery without the evolution of its first gait, on one thread.
    """

    robot: str
    case: int
    truth: str
    seed: int
    comparator: str
    compared_by: str
    best: str
    correct: bool
    before: float
    after: float
    recovered: float
    distinct_hypotheses: int
    diverged: int
    seconds: float

    @property
    def ratio(self) -> float:
        """Displacement of the best recovery trial over that before the failure; may be NaN."""
        return ratio(self.recovered, self.before)


@dataclass(frozen=True)
class TrialRow:
    """One physical trial of a recovery.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I.
        seed: Seed of the run.
        comparator: Name of the comparator as requested.
        number: Number of the trial: 0 before the failure, 1 the failing one, then the recovery.
        stage: ``before``, ``after`` or ``recovery``.
        hypothesis: Best hypothesis when the controller was chosen, in notation.
        displacement: Forward displacement, m.
    """

    robot: str
    case: int
    seed: int
    comparator: str
    number: int
    stage: str
    hypothesis: str
    displacement: float


@dataclass(frozen=True)
class EvolutionRow:
    """One generation of the repair EA on the damaged robot, in which a trial is an evaluation.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I.
        seed: Seed of the run.
        evaluations: Number of controllers evaluated so far, each in a physical trial.
        before: Forward displacement before the failure, m.
        best: Largest forward displacement so far, m.
    """

    robot: str
    case: int
    seed: int
    evaluations: int
    before: float
    best: float


Run = tuple[str, int, int]
"""Robot, case and seed."""


def ratio(displacement: float, before: float) -> float:
    """Returns a displacement over that before the failure; NaN unless the latter is above 0."""
    return displacement / before if before > 0 else math.nan


def run_of(row: RecoveryRow | TrialRow | EvolutionRow) -> Run:
    """Returns the run of a row."""
    return row.robot, row.case, row.seed


def rows_of(
    experiment: Experiment, comparator: str, outcome: Outcome
) -> tuple[RecoveryRow, list[TrialRow]]:
    """Returns the rows of a recovery: its own, and one per physical trial.

    Args:
        experiment: Definition of the recovery.
        comparator: Name of the comparator as requested.
        outcome: Result of the recovery.
    """
    if experiment.case is None:
        raise ValueError("expected a failure of Table I, got one without a number")
    recovery = outcome.recovery
    trials = [
        TrialRow(
            robot=experiment.robot.name,
            case=experiment.case,
            seed=experiment.seed,
            comparator=comparator,
            number=number,
            stage=trial.plan.stage,
            hypothesis=str(tried),
            displacement=trial.displacement,
        )
        for number, (trial, tried) in enumerate(zip(recovery.trials, recovery.tried, strict=True))
    ]
    row = RecoveryRow(
        robot=experiment.robot.name,
        case=experiment.case,
        truth=str(experiment.truth),
        seed=experiment.seed,
        comparator=comparator,
        compared_by=recovery.comparator.comparator.name,
        best=str(recovery.diagnosis.best),
        correct=outcome.correct,
        before=recovery.before,
        after=recovery.after,
        recovered=recovery.recovered,
        distinct_hypotheses=recovery.distinct_hypotheses,
        diverged=outcome.stats.diverged,
        seconds=outcome.seconds,
    )
    return row, trials


def best_so_far(trials: Sequence[TrialRow]) -> list[float]:
    """Returns the share of the displacement before the failure that trials restored.

    Args:
        trials: All trials of one recovery, in order.

    Returns:
        First that of the failing trial, then that of the best recovery trial so far.
    """
    before, after, *recovery = (trial.displacement for trial in trials)
    largest = [max(recovery[: count + 1]) for count in range(len(recovery))]
    return [ratio(displacement, before) for displacement in (after, *largest)]
