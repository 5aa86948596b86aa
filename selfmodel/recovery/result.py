"""Events of a recovery, and its result."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from selfmodel.arrays import data_frame, finite_or_none
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.progress import Progress
from selfmodel.recovery.candidates import FINER, LOSS
from selfmodel.recovery.falls import fall_text
from selfmodel.recovery.scores import DISPLACEMENT, Score, score_label, value_text
from selfmodel.robot.robot import Robot
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


@dataclass(frozen=True)
class Restored:
    """End of a recovery before all of its trials, which a robot that walks as before needs not."""

    def __str__(self) -> str:
        return "the robot walks as before the failure: no further trial"


@dataclass(frozen=True)
class TrialScore:
    """Score of a trial by the best hypothesis so far; an event again if a diagnosis changes it.

    Attributes:
        hypothesis: Intact before the failure; after it, the best hypothesis of the last diagnosis.
            It matters for a score that depends on the ground or on detached limbs.
        value: Its value; NaN if unobserved.
        fall: Step at which the robot fell; None if it did not.
    """

    trial: Trial
    hypothesis: Hypothesis
    score: Score
    value: float
    fall: int | None

    def __str__(self) -> str:
        most = self.score.most(self.trial.trajectory.steps)
        result = f"{self.score.name} {value_text(self.value, self.score.unit, most)}"
        return f"trial {self.trial.plan.name} by {self.hypothesis}: {result}{fall_text(self.fall)}"

    @property
    def result(self) -> str:
        """The value, with the fall or the early end of the trial, as text."""
        return f"{self.value:.3f}{fall_text(self.fall)}{self.trial.early_end}"


@dataclass(frozen=True)
class SelfModelWarning:
    """A trial far below its predicted score, or a self-model that flatters; the likely cause."""

    text: str

    def __str__(self) -> str:
        return f"warning: {self.text}"


Event = (
    SearchBegins
    | Generation
    | Progress
    | ChosenComparator
    | Calibration
    | DiscriminatingTrial
    | Restored
    | Trial
    | TrialScore
    | SelfModelWarning
    | Diagnosis
)
"""What a recovery or a diagnosis reports to a callback as it happens: the start or a generation of
a search, the progress of another stage, the chosen comparator, the calibration, a finished trial,
its score, a warning about the self-model, a diagnosis, an end before all trials. ``print`` shows
each as text, those of a stage with the time left."""


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
        predicted: Score of each trial that the self-model predicted: of one simulation without
            noise under the best hypothesis at the time. NaN for the first trial after the failure,
            and if the simulation diverged.
        robust_means: Mean score of each trial's controller in the last simulations of its repair,
            under its noise and uncertainty. NaN for the first trial after the failure, and for a
            controller that was not among the candidates.
        scored: Score and fall of each trial; those after the failure under the last diagnosis.
        calibration: Fit of the self-model to the trials before the failure; None without one.
        score: Fitness of the repair.
        warnings: Where the self-model foresees more than the robot does, with the likely cause.
    """

    trials: tuple[Trial, ...]
    tried: tuple[Hypothesis, ...]
    diagnosis: Diagnosis
    repair_evaluations: int
    diagnostic_evaluations: int
    distinct_hypotheses: int
    comparator: ChosenComparator
    predicted: tuple[float, ...]
    robust_means: tuple[float, ...]
    scored: tuple[TrialScore, ...]
    calibration: Calibration | None = None
    score: Score = DISPLACEMENT
    warnings: tuple[str, ...] = ()

    @property
    def scores(self) -> tuple[float, ...]:
        """Score of each trial."""
        return tuple(one.value for one in self.scored)

    @property
    def falls(self) -> tuple[int | None, ...]:
        """Step at which the robot fell in each trial; None if it did not."""
        return tuple(one.fall for one in self.scored)

    def scores_by(self, score: Score, robot: Robot) -> tuple[float, ...]:
        """Returns any score of each trial, by the same hypotheses; ``robot`` is the nominal one."""
        if score == self.score:
            return self.scores
        model = self.calibration.robot if self.calibration else robot
        return tuple(score.of_trial(model, one.hypothesis, one.trial) for one in self.scored)

    @property
    def best_trial(self) -> int:
        """Number of the recovery trial with the largest score, of those without a fall if any.

        It is the first of them if all scores are NaN.
        """
        ranks = [(not math.isnan(it.value), it.fall is None, it.value) for it in self.scored]
        return max(range(2, len(ranks)), key=ranks.__getitem__)

    @property
    def fell(self) -> bool:
        """Whether the robot fell in the best recovery trial, and so in all that have a score."""
        return self.falls[self.best_trial] is not None

    @property
    def best_score(self) -> float:
        """Score of the best recovery trial; NaN if unobserved in all."""
        return self.scores[self.best_trial]

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
        """Forward displacement in the best recovery trial, m.

        NaN if the base was not observed in that trial.
        """
        return self.trials[self.best_trial].displacement

    @property
    def recovery(self) -> float | None:
        """Recovered displacement as a share of that before; None if the robot fell, or had none."""
        return self.recovered / self.before if self.before > 0 and not self.fell else None

    def __repr__(self) -> str:
        rows = self.table
        widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
        lines = [
            f"  {name:{widths[0]}}  {tried:{widths[1]}}  {result}" for name, tried, result in rows
        ]
        title = f"<Recovery: {self.diagnosis.best}, {self.diagnosis.verdict}"
        warnings = [f"  warning: {text}" for text in self.warnings]
        return "\n".join([title, *lines, *warnings]) + ">"

    @property
    def table(self) -> list[tuple[str, str, str]]:
        """The physical trials as rows of text with a heading, as the command line shows them."""
        label = score_label(self.score.name, self.score.unit)
        rows = zip(self.scored, self.tried, strict=True)
        return [
            ("trial", "best hypothesis so far", label),
            *((one.trial.plan.name, str(tried), one.result) for one, tried in rows),
        ]

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
            "warnings": list(self.warnings),
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the physical trials as a ``pandas.DataFrame``, one row per trial."""
        return data_frame(self._rows())

    def plot(self) -> Any:  # noqa: ANN401  # matplotlib is slow to import
        """Returns the scores of the trials, and those predicted, as a ``matplotlib`` figure."""
        from selfmodel.style import values_by_name  # noqa: PLC0415  # matplotlib is slow to import

        names = [trial.plan.name for trial in self.trials]
        predicted = ("predicted by the self-model", self.predicted)
        label = score_label(self.score.name, self.score.unit)
        return values_by_name(str(self.diagnosis.best), label, names, self.scores, others=predicted)

    def _rows(self) -> list[dict[str, Any]]:
        forecasts = self.predicted, self.robust_means
        columns = zip(self.trials, self.tried, self.scored, *forecasts, strict=True)
        return [
            {
                "trial": trial.plan.name,
                "stage": trial.plan.stage,
                "hypothesis": str(tried),
                "displacement": finite_or_none(trial.displacement),
                "score": finite_or_none(score.value),
                "predicted_score": finite_or_none(predicted),
                "robust_mean": finite_or_none(mean),
                "steps": trial.trajectory.steps,
                "ended_early": trial.early_end != "",
                "fell_at_step": score.fall,
                "log": trial.path,
            }
            for trial, tried, score, predicted, mean in columns
        ]


SHORTFALL = 0.5
"""Share of the predicted score below which a trial is a warning."""


def shortfall(
    found: TrialScore,
    predicted: float,
    tried: Hypothesis,
    robot: Robot,
    simulated: Callable[[Robot], float],
) -> str | None:
    """Returns a sentence on a trial that falls short of its prediction; None for any other.

    The cause is the fall of the robot, an early end, a diagnosis that the trial refuted, or else
    the self-model: its time step, if it loses the score at a quarter of it, or its parameters.

    Args:
        found: Score of the trial.
        predicted: Score that was predicted; NaN if none was.
        tried: Hypothesis at the time.
        robot: The self-model of today.
        simulated: Returns the score of the controller in one simulation of a robot without noise;
            NaN if it diverges.
    """
    if not (predicted > 0 and found.value < SHORTFALL * predicted):
        return None
    score, trial = found.score, found.trial
    walked, before = (value_text(one, score.unit) for one in (found.value, predicted))
    said = f"trial {trial.plan.name}: {score.name} {walked}, where {before} was predicted: "
    if ended := fall_text(found.fall) + trial.early_end:
        return f"{said}the robot{ended.removeprefix(',')}"
    if tried != found.hypothesis:
        return f"{said}the diagnosis was {tried}, and is {found.hypothesis} with this trial"
    coarse, fine = simulated(robot), simulated(robot.finer(FINER))
    share = value_text(fine, score.unit)
    if not coarse - fine < LOSS * abs(coarse):
        return (
            f"{said}the self-model flatters, and predicts {share} at a quarter of its physics time "
            f"step; {advice(robot)}"
        )
    return (
        f"{said}the self-model predicts {share} at a quarter of its physics time step too, so its "
        f"motors, contacts or mass differ from the robot's: calibrate it with more healthy trials, "
        f"or give it the robot's armature, damping, friction and solref"
    )


def advice(robot: Robot) -> str:
    """Returns what to change about a robot whose motion depends on the time step, as text."""
    timestep = float(robot.model.opt.timestep) / FINER
    return (
        f"give its model timestep={timestep:.6g}, or armature, the inertia of the rotors at the "
        f"joints (`selfmodel robots FILE` has numbers)"
    )
