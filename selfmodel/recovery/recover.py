"""The paper's algorithm: run and log a trial, diagnose, repair, with few physical trials."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.comparator_choice import ChosenComparator, ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.candidate import Candidate, MakeRepair, unpredicted
from selfmodel.recovery.database import Database, Journal, RunTrial
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.recovery.next_trial import NextTrial, Situation, by_repair
from selfmodel.recovery.random_streams import choice_stream, diagnosis_stream, repair_stream
from selfmodel.recovery.robust_repair import RobustRepair
from selfmodel.recovery.uncertainty import assumed_uncertainty, estimated_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.data_frame import data_frame
from selfmodel.trials.trial import Stage, Trial, TrialPlan


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
        calibration: Fit of the self-model to the trials before the failure; None without one.
        score: Fitness of the repair.
        predicted: Score that the self-model predicted of each trial's controller when it was chosen;
            NaN if none was predicted, as for the first trial after the failure.
        scores: Score of each trial; those after the failure under the last diagnosis, which matters
            for a score that depends on the ground or on detached limbs.
    """

    trials: tuple[Trial, ...]
    tried: tuple[Hypothesis, ...]
    diagnosis: Diagnosis
    repair_evaluations: int
    diagnostic_evaluations: int
    distinct_hypotheses: int
    comparator: ChosenComparator
    calibration: Calibration | None = None
    score: Score = DISPLACEMENT
    predicted: tuple[float, ...] = ()
    scores: tuple[float, ...] = ()

    @property
    def best_score(self) -> float:
        """Largest score of the recovery trials; NaN if unobserved in all."""
        return _largest(self.scores[2:])

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
        """Largest forward displacement of the recovery trials, m; NaN if unobserved in all."""
        return _largest([trial.displacement for trial in self.trials[2:]])

    def __repr__(self) -> str:
        lines = [f"<Recovery: {self.diagnosis.best}, {self.diagnosis.verdict}"]
        lines += [
            f"  {trial.plan.name:14} {trial.displacement:8.3f} m  {tried}"
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
                "before": _observed(self.before),
                "after": _observed(self.after),
                "recovered": _observed(self.recovered),
            },
            "diagnosis": self.diagnosis.to_dict(),
            "evaluations": {
                "repair": self.repair_evaluations,
                "diagnostic": self.diagnostic_evaluations,
                "distinct_hypotheses": self.distinct_hypotheses,
            },
        }

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas is optional
        """Returns the physical trials as a ``pandas.DataFrame``, one row per trial.

        Raises:
            InputError: pandas is not installed.
        """
        return data_frame(self._rows())

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "trial": trial.plan.name,
                "stage": trial.plan.stage,
                "hypothesis": str(tried),
                "displacement": _observed(trial.displacement),
                "score": _observed(score),
                "predicted_score": _observed(predicted),
                "log": trial.path,
            }
            for trial, tried, score, predicted in zip(
                self.trials, self.tried, self.scores, self.predicted, strict=True
            )
        ]


def _largest(values: Sequence[float]) -> float:
    return max((value for value in values if not math.isnan(value)), default=math.nan)


def _observed(displacement: float) -> float | None:
    """JSON has no NaN, which is the displacement of an unobserved base."""
    return None if math.isnan(displacement) else displacement


def recover(
    *,
    healthy: PhysicalRobot,
    damaged: PhysicalRobot,
    simulator: Simulator,
    choose_comparator: ComparatorChoice,
    run_trial: RunTrial,
    journal: Journal,
    settings: Settings,
    seed: int,
    on_event: Callable[[Event], None],
    gait: Controller | None = None,
    design: Design | None = None,
    kinds: Sequence[FaultKind] = DEFAULT_KINDS,
    calibrate: Callable[[Sequence[Trial]], Calibration] | None = None,
    next_trial: NextTrial = by_repair,
    score: Score = DISPLACEMENT,
    make_repair: MakeRepair = RobustRepair,
) -> Recovery:
    """Runs the recovery of a robot: a healthy trial, a failing one, then diagnosis and repair.

    Args:
        healthy: Physical robot before the failure.
        damaged: Physical robot after the failure.
        simulator: Self-model.
        choose_comparator: Chooses the comparator: checked with the trial before the failure, and
            chosen with the failing trial as well.
        run_trial: Runs and logs a physical trial. The trial that ``run_trial`` returns is all that
            the algorithm observes of the robot.
        journal: Storage of the diagnoses.
        settings: The paper's numbers.
        seed: Seed of all random choices.
        on_event: Callback, called with each event as it happens.
        gait: Controller of the robot before the failure; evolved if not given. The rest of the
            recovery does not depend on whether the same gait is evolved or given.
        design: Design of the controllers to evolve; the paper's network if not given.
        kinds: Fault kinds that a diagnosis searches.
        calibrate: Fits the self-model to the trials before the failure; no fit if not given.
        next_trial: Chooses the controller of each trial after the failing one.
        score: Fitness of the repair.
        make_repair: Makes the repair, which evolves the controllers.

    Returns:
        The trials, the last diagnosis and the number of evaluations.
    """
    # From the nominal robot: the numbers of the calibrated model are rounded.
    design = network_for(simulator.robot) if design is None else design
    uncertainty = assumed_uncertainty(simulator.robot.anatomy)
    repair = make_repair(simulator, settings, design, score, uncertainty)
    earlier_evaluations = 0
    tried: list[Hypothesis] = []
    predicted: list[float] = []
    database = Database()

    def evolve_candidates(hypotheses: Sequence[Hypothesis]) -> tuple[Candidate, ...]:
        on_event(SearchBegins("repair", hypotheses[0]))
        rng = repair_stream(seed, len(database.diagnoses))
        return repair(hypotheses, database.controllers, rng, on_event)

    def diagnose() -> Diagnosis:
        nonlocal database
        on_event(SearchBegins("diagnostic"))
        rng = diagnosis_stream(seed, len(database.diagnoses) + 1)
        diagnosis = search(database.evidence, database.hypotheses, rng, on_event)
        journal.add(diagnosis)
        database = database.with_diagnosis(diagnosis)
        on_event(diagnosis)
        return diagnosis

    def act(robot: PhysicalRobot, stage: Stage, best: Hypothesis, candidate: Candidate) -> None:
        nonlocal database
        name = f"{len(tried):02d}-{stage}"
        plan = TrialPlan(name, stage, candidate.controller, settings.steps, seed)
        tried.append(best)
        predicted.append(candidate.predicted)
        trial = run_trial(robot, plan)
        database = database.with_trial(trial)
        on_event(trial)

    HypothesisSpace.of(kinds, simulator.robot.anatomy)  # before any physical trial
    first = unpredicted(gait) if gait is not None else evolve_candidates((INTACT,))[0]
    act(healthy, "before", INTACT, first)
    healthy_trials = database.trials
    choose_comparator(simulator.robot, healthy_trials)  # before the calibration and the failure
    calibration = calibrate(healthy_trials) if calibrate else None
    if calibration is not None:
        on_event(calibration)
        if calibration.robot is not simulator.robot:
            simulator = Simulator(
                calibration.robot, simulator.threads, simulator.stats, simulator.budget
            )
    uncertainty = estimated_uncertainty(simulator, healthy_trials, calibration)
    earlier_evaluations = repair.evaluations
    repair = make_repair(simulator, settings, design, score, uncertainty)
    act(damaged, "after", INTACT, unpredicted(first.controller))
    chosen = choose_comparator(simulator.robot, database.trials)
    on_event(chosen)
    search = DiagnosticSearch(simulator, chosen.comparator, settings, kinds, intact=healthy_trials)
    for trials_left in range(settings.trials, 0, -1):
        diagnosis = diagnose()
        hypotheses = (diagnosis.best, *diagnosis.indistinguishable)
        situation = Situation(
            known=database,
            trials_left=trials_left,
            simulator=simulator,
            settings=settings,
            rng=choice_stream(seed, len(database.diagnoses)),
            repaired=partial(evolve_candidates, hypotheses),
            on_event=on_event,
        )
        act(damaged, "recovery", diagnosis.best, next_trial(situation))
    diagnosis = diagnose()

    return Recovery(
        trials=database.trials,
        tried=tuple(tried),
        diagnosis=diagnosis,
        repair_evaluations=earlier_evaluations + repair.evaluations,
        diagnostic_evaluations=search.evaluations,
        distinct_hypotheses=search.distinct_hypotheses,
        comparator=chosen,
        calibration=calibration,
        score=score,
        predicted=tuple(predicted),
        scores=tuple(
            score.of_trial(simulator.robot, diagnosis.best if number else INTACT, trial)
            for number, trial in enumerate(database.trials)
        ),
    )
