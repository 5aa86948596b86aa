"""Row of the results table of an ablation: one diagnosis."""

from dataclasses import dataclass

from selfmodel.plugins import OWN_SEARCH, PAPER


@dataclass(frozen=True)
class AblationRow:
    """Diagnosis by one comparator, with its truth and its cost; None for unknown values.

    Attributes:
        robot: Name of the robot.
        case: Number of the failure in Table I; None for a failure that is not in it.
        truth: The failure, in notation.
        gap: Level of the reality gap.
        seed: Seed of the run.
        next_trial: Choice of the trials' controllers.
        comparator: Name of the comparator, or ``package.module:object``.
        trials: Number of trials of the damaged robot that the diagnosis explains.
        best: The hypothesis ranked first, in notation.
        correct: Whether the best hypothesis is the truth, or behaves like the truth in all trials.
        distance: Distance of the best hypothesis, in the comparator's unit.
        intact_distance: Distance of the empty hypothesis, in the comparator's unit.
        verdict: Verdict of the diagnosis.
        ``rivals``: Number of hypotheses indistinguishable from the best, ten at most.
        evaluations: Number of hypotheses evaluated since the first trial.
        distinct_hypotheses: Number of distinct hypotheses among the evaluations.
        seconds: Wall time of the diagnoses since the first trial, on one thread.
        before: Score before the failure; the forward displacement, m, by default.
        after: Score of the same controller after the failure.
        recovered: Score of the best recovery trial so far.
        repair: Name of the repair that evolved gaits or recoveries; None if nothing was evolved,
            as all gaits were given. Versions that did not record it had the paper's alone.
        search: Name of the search of the repair; None if nothing was evolved.
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
    repair: str | None = PAPER
    search: str | None = OWN_SEARCH[PAPER]

    @property
    def run(self) -> tuple[str, str, float, int]:
        """Run of the row, shared by all comparators: robot, truth, gap, seed."""
        return self.robot, self.truth, self.gap, self.seed

    @property
    def failure(self) -> str:
        """Name of the failure: its number in Table I, or its notation."""
        return self.truth if self.case is None else f"{self.case:2d}"
