"""Events of a recovery, and its result."""

import math
from dataclasses import dataclass
from typing import Any

from selfmodel.arrays import data_frame, finite_or_none
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.progress import Progress
from selfmodel.recovery.scores import DISPLACEMENT, Score
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial


@dataclass(frozen=True)
class SearchBegins:
    """Start of a search: a ``repair``, for a hypothesis, or a ``diagnostic`` one."""

    kind: str
    hypothesis: Hypothesis | None = None

    @property
    def search(self) -> str:
        """Name of the kind of search as text."""
        return "diagnostic EA" if self.kind == "diagnostic" else self.kind

    def __str__(self) -> str:
        return self.search if self.hypothesis is None else f"{self.search} for {self.hypothesis}"


@dataclass(frozen=True)
class DiscriminatingTrial:
    """Start of a search for the controller whose trial separates hypotheses, best first."""

    hypotheses: tuple[Hypothesis, ...]

    def __str__(self) -> str:
        return f"the next trial discriminates between: {', '.join(map(str, self.hypotheses))}"


Event = (
    SearchBegins
    | Generation
    | Progress
    | ChosenComparator
    | Calibration
    | DiscriminatingTrial
    | Trial
    | Diagnosis
)
"""What a recovery or a diagnosis reports to a callback as it happens: the start or a generation of
a search, the progress of another stage, the chosen comparator, the calibration, a finished trial, a
diagnosis. ``print`` shows each as text, those of a stage with the time left."""


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery.

    Attributes:
        trials: Physical trials, in order: ``before``, ``after``, then those of stage ``recovery``.
        tried: Best hypothesis at the time when the controller was chosen, one per trial.
        diagnosis: Last diagnosis, which explains all trials.
        repair_evaluations: Number of controllers that the repair evaluated.
        diagnostic_evaluations: Number of hypotheses that the diagnostic EA evaluated.
        distinct_hypotheses: Number of distinct hypotheses among them.
        comparator: Comparator of the diagnoses, and the reason for its choice.
        predicted: Score that the self-model predicted of each trial's controller; NaN if none was
            predicted, as for the first trial after the failure.
        scores: Score of each trial; those after the failure under the last diagnosis, which matters
            for a score that depends on the ground or on detached limbs.
        falls: Step at which the robot fell in each trial; None if it did not.
        calibration: Fit of the self-model to the trials before the failure; None without one.
        score: Fitness of the repair.
    """

    trials: tuple[Trial, ...]
    tried: tuple[Hypothesis, ...]
    diagnosis: Diagnosis
    repair_evaluations: int
    diagnostic_evaluations: int
    distinct_hypotheses: int
    comparator: ChosenComparator
    predicted: tuple[float, ...]
    scores: tuple[float, ...]
    falls: tuple[int | None, ...]
    calibration: Calibration | None = None
    score: Score = DISPLACEMENT

    @property
    def _best(self) -> int:
        """Number of the recovery trial with the largest score; of the first if all are NaN."""
        known = [-math.inf if math.isnan(score) else score for score in self.scores]
        return max(range(2, len(known)), key=known.__getitem__)

    @property
    def fell(self) -> bool:
        """Whether the robot fell in the recovery trial with the largest score."""
        return self.falls[self._best] is not None

    @property
    def best_score(self) -> float:
        """Largest score of the recovery trials; NaN if unobserved in all."""
        return self.scores[self._best]

    @property
    def before(self) -> float:
        """Forward displacement before the failure, m."""
        return self.trials[0].displacement

    @property
    def after(self) -> float:
        """Forward displacement of the same controller after the failure, m."""
        return self.trials[1].displacement

    @property
    def recovered(self) -> float:
        """Forward displacement in the recovery trial with the largest score, m.

        NaN if the base was not observed in that trial.
        """
        return self.trials[self._best].displacement

    def __repr__(self) -> str:
        lines = [f"<Recovery: {self.diagnosis.best}, {self.diagnosis.verdict}"]
        lines += [
            f"  {trial.plan.name:14} {trial.displacement:8.3f} m  {tried}{trial.early_end}"
            for trial, tried in zip(self.trials, self.tried, strict=True)
        ]
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the result as JSON values: trials, displacements in m, diagnosis, evaluations.

        A displacement is None where the base was not observed.
        """
        return {
            "trials": self._rows(),
            "displacement": {
                "before": finite_or_none(self.before),
                "after": finite_or_none(self.after),
                "recovered": finite_or_none(self.recovered),
            },
            "diagnosis": self.diagnosis.to_dict(),
            "evaluations": {
                "repair": self.repair_evaluations,
                "diagnostic": self.diagnostic_evaluations,
                "distinct_hypotheses": self.distinct_hypotheses,
            },
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the physical trials as a ``pandas.DataFrame``, one row per trial."""
        return data_frame(self._rows())

    def plot(self) -> Any:  # noqa: ANN401  # matplotlib is slow to import
        """Returns the scores of the trials, and those predicted, as a ``matplotlib`` figure."""
        from selfmodel.plots import values_by_name  # noqa: PLC0415  # matplotlib is slow to import

        names = [trial.plan.name for trial in self.trials]
        predicted = ("predicted by the self-model", self.predicted)
        title, label = str(self.diagnosis.best), f"{self.score.name} {self.score.unit}".strip()
        return values_by_name(title, label, names, self.scores, others=predicted)

    def _rows(self) -> list[dict[str, Any]]:
        columns = zip(self.trials, self.tried, self.scores, self.predicted, strict=True)
        return [
            {
                "trial": trial.plan.name,
                "stage": trial.plan.stage,
                "hypothesis": str(tried),
                "displacement": finite_or_none(trial.displacement),
                "score": finite_or_none(score),
                "predicted_score": finite_or_none(predicted),
                "log": trial.path,
            }
            for trial, tried, score, predicted in columns
        ]
