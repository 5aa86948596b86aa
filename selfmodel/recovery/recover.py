"""The paper's algorithm: act, log, diagnose, repair, with as few physical trials as possible."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS, applicable_kinds
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.database import Journal
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.recovery.next_trial import NextTrial, Situation, by_repair
from selfmodel.recovery.random_streams import choice_stream, diagnosis_stream, repair_stream
from selfmodel.recovery.repair import RepairSearch
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.calibrate import Calibration
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Stage, Trial, TrialPlan


@dataclass(frozen=True)
class Recovery:
    """How a recovery went.

    Attributes:
        trials: Every physical trial, in order: ``before``, ``after``, then the recoveries.
        tried: The best hypothesis when each trial's controller was chosen.
        diagnosis: The last one, which explains all trials.
        repair_evaluations: Controllers that the repair EA asked about.
        diagnostic_evaluations: Hypotheses that the diagnostic EA asked about.
        distinct_hypotheses: How many of those differ.
        calibration: How the self-model was fitted to the trials before the failure, if it was.
    """

    trials: tuple[Trial, ...]
    tried: tuple[Hypothesis, ...]
    diagnosis: Diagnosis
    repair_evaluations: int
    diagnostic_evaluations: int
    distinct_hypotheses: int
    calibration: Calibration | None = None

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
        """Forward displacement of the best of the recovery trials, m.

        NaN if it was observed in none of them.
        """
        ways = [trial.displacement for trial in self.trials[2:]]
        return max((way for way in ways if not math.isnan(way)), default=math.nan)


def recover(
    *,
    healthy: PhysicalRobot,
    damaged: PhysicalRobot,
    simulator: Simulator,
    comparator: Comparator,
    journal: Journal,
    settings: Settings,
    seed: int,
    on_event: Callable[[Event], None],
    gait: Controller | None = None,
    design: Design | None = None,
    kinds: Sequence[FaultKind] = PAPER_KINDS,
    calibrate: Callable[[Sequence[Trial]], Calibration] | None = None,
    next_trial: NextTrial = by_repair,
    score: Score = DISPLACEMENT,
) -> Recovery:
    """Lets a robot walk until it fails, then finds out what is wrong and how it walks again.

    Args:
        healthy: The physical robot before it fails.
        damaged: The same robot afterwards.
        simulator: The self-model.
        comparator: Judges hypotheses by the logged trials.
        journal: Keeps the trials and diagnoses; everything about the past is read back from it.
        settings: The paper's numbers.
        seed: Every random choice comes from it.
        on_event: Is told what happens.
        gait: How the robot walks before it fails; evolved if there is none. The rest of the
            recovery is the same whether a gait was evolved here, or earlier from the same seed.
        design: The kind of controller to evolve; the paper's network if none is given.
        kinds: What a diagnosis considers.
        calibrate: Fits the self-model to the trials before the failure; without it, the self-model
            stays as it is.
        next_trial: Chooses the controller of each trial after the failing one.
        score: What controllers are evolved for.

    Returns:
        What the journal says at the end.
    """
    # As the robot's own model says: a fitted one is written with fewer digits.
    design = network_for(simulator.robot) if design is None else design
    repair = RepairSearch(simulator, settings, design, score=score)
    tried: list[Hypothesis] = []

    def evolve_controller(hypothesis: Hypothesis) -> Controller:
        on_event(SearchBegins("repair", hypothesis))
        known = journal.read()
        rng = repair_stream(seed, len(known.diagnoses))
        return repair(hypothesis, known.controllers, rng, on_event)

    def diagnose_trials() -> Diagnosis:
        on_event(SearchBegins("diagnostic"))
        known = journal.read()
        rng = diagnosis_stream(seed, len(known.diagnoses) + 1)
        diagnosis = diagnose(known.evidence, known.hypotheses, rng, on_event)
        journal.note(diagnosis)
        on_event(diagnosis)
        return diagnosis

    def act(robot: PhysicalRobot, stage: Stage, believed: Hypothesis, by: Controller) -> None:
        plan = TrialPlan(f"{len(tried):02d}-{stage}", stage, by, settings.steps, seed)
        tried.append(believed)
        on_event(journal.record(robot, plan))

    applicable_kinds(kinds, simulator.robot.anatomy)  # before any trial is spent
    if gait is None:
        gait = evolve_controller(INTACT)
    act(healthy, "before", INTACT, gait)
    intact = journal.read().trials
    calibration = calibrate(intact) if calibrate else None
    if calibration is not None:
        on_event(calibration)
        if calibration.robot is not simulator.robot:
            simulator = Simulator(calibration.robot, simulator.threads, simulator.stats)
            repair = RepairSearch(simulator, settings, design, repair.evaluations, score)
    diagnose = DiagnosticSearch(simulator, comparator, settings, kinds, intact=intact)
    act(damaged, "after", INTACT, gait)
    for trials_left in range(settings.trials, 0, -1):
        believed = diagnose_trials().best
        known = journal.read()
        situation = Situation(
            known=known,
            trials_left=trials_left,
            simulator=simulator,
            settings=settings,
            rng=choice_stream(seed, len(known.diagnoses)),
            repaired=partial(evolve_controller, believed),
            on_event=on_event,
        )
        act(damaged, "recovery", believed, next_trial(situation))
    diagnosis = diagnose_trials()

    return Recovery(
        trials=journal.read().trials,
        tried=tuple(tried),
        diagnosis=diagnosis,
        repair_evaluations=repair.evaluations,
        diagnostic_evaluations=diagnose.evaluations,
        distinct_hypotheses=diagnose.distinct_hypotheses,
        calibration=calibration,
    )
