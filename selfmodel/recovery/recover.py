"""The paper's algorithm: run and log a trial, diagnose, repair, with few physical trials."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.comparator_choice import ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.database import Database, Journal, RunTrial
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.next_trial import NextTrial, Situation, by_repair
from selfmodel.recovery.posterior import Posterior
from selfmodel.recovery.random_streams import (
    choice_stream,
    diagnosis_stream,
    posterior_stream,
    repair_stream,
)
from selfmodel.recovery.recovery import Recovery
from selfmodel.recovery.repair.candidate_controller import CandidateController, MakeRepair
from selfmodel.recovery.repair.robust_repair import RobustRepair
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.upright import UPRIGHT, fall_of
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Stage, Trial, TrialPlan

Judged = TypeVar("Judged")


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
    score: Score = UPRIGHT,
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
    repair, evaluations_before = make_repair(simulator, settings, design, score), 0
    tried: list[Hypothesis] = []
    predicted: list[float] = []
    predictions: dict[Controller, float] = {}
    database = Database()

    def evolve_candidates(
        hypotheses: Sequence[Hypothesis], uncertainty: Callable[[], Uncertainty]
    ) -> tuple[CandidateController, ...]:
        on_event(SearchBegins("repair", hypotheses[0]))
        rng = repair_stream(seed, len(database.diagnoses))
        found = repair(hypotheses, uncertainty, database.controllers, rng, on_event)
        predictions.update({candidate.controller: candidate.predicted for candidate in found})
        return found

    def diagnose() -> Diagnosis:
        nonlocal database
        on_event(SearchBegins("diagnostic"))
        rng = diagnosis_stream(seed, len(database.diagnoses) + 1)
        diagnosis = search(database.evidence, database.hypotheses, rng, on_event)
        journal.add(diagnosis)
        database = database.with_diagnosis(diagnosis)
        on_event(diagnosis)
        return diagnosis

    def act(robot: PhysicalRobot, stage: Stage, best: Hypothesis, controller: Controller) -> None:
        nonlocal database
        plan = TrialPlan(f"{len(tried):02d}-{stage}", stage, controller, settings.steps, seed)
        tried.append(best)
        predicted.append(math.nan if stage == "after" else predictions.get(controller, math.nan))
        trial = run_trial(robot, plan)
        database = database.with_trial(trial)
        on_event(trial)

    HypothesisSpace.of(kinds, simulator.robot.anatomy)  # before any physical trial
    gait = (
        gait
        or evolve_candidates((INTACT,), partial(assumed_uncertainty, simulator.robot))[0].controller
    )
    act(healthy, "before", INTACT, gait)
    healthy_trials = database.trials
    choose_comparator(simulator.robot, healthy_trials)  # before the calibration and the failure
    calibration = calibrate(healthy_trials) if calibrate else None
    if calibration is not None:
        on_event(calibration)
        if calibration.robot is not simulator.robot:
            simulator, evaluations_before = _fitted(simulator, calibration), repair.evaluations
            repair = make_repair(simulator, settings, design, score)
    posterior = Posterior(simulator, healthy_trials, calibration, settings, posterior_stream(seed))
    act(damaged, "after", INTACT, gait)
    chosen = choose_comparator(simulator.robot, database.trials)
    on_event(chosen)
    search = DiagnosticSearch(simulator, chosen.comparator, settings, kinds, intact=healthy_trials)
    for trials_left in range(settings.trials, 0, -1):
        diagnosis = diagnose()
        alike = (diagnosis.best, *diagnosis.indistinguishable)
        uncertainty = partial(posterior.after, database.trials, diagnosis.best)
        situation = Situation(
            known=database,
            trials_left=trials_left,
            simulator=simulator,
            settings=settings,
            rng=choice_stream(seed, len(database.diagnoses)),
            repaired=partial(evolve_candidates, alike, uncertainty),
            on_event=on_event,
        )
        act(damaged, "recovery", diagnosis.best, next_trial(situation))
    diagnosis = diagnose()

    return Recovery(
        trials=database.trials,
        tried=tuple(tried),
        diagnosis=diagnosis,
        repair_evaluations=evaluations_before + repair.evaluations,
        diagnostic_evaluations=search.evaluations,
        distinct_hypotheses=search.distinct_hypotheses,
        comparator=chosen,
        calibration=calibration,
        score=score,
        predicted=tuple(predicted),
        scores=_judged(score.of_trial, simulator.robot, diagnosis.best, database.trials),
        falls=_judged(fall_of, simulator.robot, diagnosis.best, database.trials),
    )


def _fitted(simulator: Simulator, calibration: Calibration) -> Simulator:
    """Returns a simulator of the calibrated self-model, with the same statistics."""
    return Simulator(calibration.robot, simulator.threads, simulator.stats)


def _judged(
    judge: Callable[[Robot, Hypothesis, Trial], Judged],
    robot: Robot,
    hypothesis: Hypothesis,
    trials: Sequence[Trial],
) -> tuple[Judged, ...]:
    """Returns a judgement of each trial, of which the first is of the healthy robot."""
    faults = (INTACT, *[hypothesis] * (len(trials) - 1))
    return tuple(judge(robot, own, trial) for own, trial in zip(faults, trials, strict=True))
