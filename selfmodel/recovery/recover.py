"""The paper's algorithm: run and log a trial, diagnose, repair, with few physical trials.

``RecoveryLoop.run`` is the whole of it, in order.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.choice import ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery import repair as repairs
from selfmodel.recovery.falls import fall_of
from selfmodel.recovery.result import Database, Event, Recovery, SearchBegins
from selfmodel.recovery.scores import UPRIGHT, Score, check_measurable, observed_in
from selfmodel.recovery.uncertainty import Posterior, assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Stage, Trial, TrialPlan

RunTrial = Callable[[PhysicalRobot, TrialPlan], Trial]
"""Runs a physical trial and returns it; with a log, as read back from the log."""


def by_repair(loop: "RecoveryLoop") -> Controller:
    """Returns the best candidate of the repair that was not tried yet, or a mutant of the best."""
    candidates = [candidate.controller for candidate in loop.repaired()]
    tried = loop.known.controllers
    untried = [controller for controller in candidates if controller not in tried]
    return (untried or repairs.untried_mutants(candidates[:1], tried, loop.settings, loop.rng))[0]


@dataclass(kw_only=True, eq=False)
class RecoveryLoop:
    """A recovery of a robot: its parts, and its state while it runs.

    Attributes:
        simulator: Self-model; after the calibration, the calibrated one.
        choose_comparator: Chooses the comparator: checked with the trial before the failure, and
            chosen with the failing trial as well.
        run_trial: Runs and logs a physical trial. The trial that ``run_trial`` returns is all that
            the algorithm observes of the robot.
        store_diagnosis: Stores a diagnosis after the earlier ones; ``run_trial`` stores the trials.
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
        known: Trials and diagnoses so far; while a trial is chosen, the last diagnosis is of all
            trials.
        trials_left: Number of trials that remain, including the one that is chosen.
        rng: Random number generator of the choice of a trial.
    """

    simulator: Simulator
    choose_comparator: ComparatorChoice
    run_trial: RunTrial
    store_diagnosis: Callable[[Diagnosis], None]
    settings: Settings
    seed: int
    on_event: Callable[[Event], None]
    gait: Controller | None = None
    design: Design | None = None
    kinds: Sequence[FaultKind] = DEFAULT_KINDS
    calibrate: Callable[[Sequence[Trial]], Calibration] | None = None
    next_trial: Callable[["RecoveryLoop"], Controller] = by_repair
    score: Score = UPRIGHT
    make_repair: repairs.MakeRepair = repairs.RobustRepair
    known: Database = field(default_factory=Database, init=False)
    trials_left: int = field(default=0, init=False)
    rng: np.random.Generator = field(init=False)

    def run(self, healthy: PhysicalRobot, damaged: PhysicalRobot) -> Recovery:
        """Runs the recovery, once, with a robot before its failure and after it.

        The robot walks with a gait that was evolved in simulation, and the self-model is fitted to
        the log. It fails, and the same gait is logged again. Then diagnosis and trial alternate:
        the diagnosis explains all logs since the failure, and the next trial tries a controller
        that the repair evolved in simulation for the diagnosed robot.
        """
        self._begin()
        gait = self.gait or self._evolve_gait()
        self._log_trial(healthy, "before", gait)
        self._fit_self_model()
        self._log_trial(damaged, "after", gait)
        self._choose_comparator()
        for left in range(self.settings.trials, 0, -1):
            self.trials_left = left
            self._diagnose()
            controller = self.next_trial(self)  # by default, the first of ``repaired``
            self._log_trial(damaged, "recovery", controller)
        self._diagnose()
        return self._result()

    def repaired(self) -> tuple[repairs.CandidateController, ...]:
        """Evolves controllers that compensate for the last diagnosis; returns them best first."""
        diagnosis = self.known.diagnoses[-1]
        uncertainty = partial(self._posterior.after, self.known.trials, diagnosis.best)
        return self._evolved((diagnosis.best, *diagnosis.indistinguishable), uncertainty)

    def _begin(self) -> None:
        HypothesisSpace.of(self.kinds, self.simulator.robot.anatomy)  # refused before any trial
        # From the nominal robot: the numbers of the calibrated model are rounded.
        self._design = self.design or network_for(self.simulator.robot)
        self._repairs: list[repairs.Repair] = []
        self._begin_repair()
        self._predictions: dict[Controller, float] = {}
        self._predicted: list[float] = []

    def _begin_repair(self) -> None:
        """Adds a repair in the simulator of now."""
        repair = self.make_repair(self.simulator, self.settings, self._design, self.score)
        self._repairs.append(repair)

    def _evolve_gait(self) -> Controller:
        assumed = partial(assumed_uncertainty, self.simulator.robot)
        return self._evolved((INTACT,), assumed)[0].controller

    def _evolved(
        self, hypotheses: Sequence[Hypothesis], uncertainty: Callable[[], DomainDistribution]
    ) -> tuple[repairs.CandidateController, ...]:
        """Evolves controllers for hypotheses, best first; returns them best first."""
        self.on_event(SearchBegins("repair", hypotheses[0]))
        rng = random_stream(self.seed, "repair", len(self.known.diagnoses))
        repair, seeds = self._repairs[-1], self.known.controllers
        candidates = repair(hypotheses, uncertainty, seeds, rng, self.on_event)
        self._predictions.update({each.controller: each.predicted for each in candidates})
        return candidates

    def _log_trial(self, robot: PhysicalRobot, stage: Stage, controller: Controller) -> None:
        name = f"{len(self.known.trials):02d}-{stage}"
        predicted = math.nan if stage == "after" else self._predictions.get(controller, math.nan)
        self._predicted.append(predicted)
        plan = TrialPlan(name, stage, controller, self.settings.steps, self.seed)
        trial = self.run_trial(robot, plan)
        self.known = replace(self.known, trials=(*self.known.trials, trial))
        self.on_event(trial)

    def _fit_self_model(self) -> None:
        """Fits the self-model to the healthy trials; a new repair simulates the fitted one."""
        healthy_trials, nominal = self.known.trials, self.simulator
        # Refused before the failure.
        check_measurable(self.score, nominal.robot, observed_in(healthy_trials[0]))
        self.choose_comparator(nominal.robot, healthy_trials)
        self._calibration = self.calibrate(healthy_trials) if self.calibrate else None
        if self._calibration is not None:
            self.on_event(self._calibration)
            if self._calibration.robot is not nominal.robot:
                self.simulator = Simulator(self._calibration.robot, nominal.threads, nominal.stats)
                self._begin_repair()
        rng = random_stream(self.seed, "posterior")
        self._posterior = Posterior(
            self.simulator, healthy_trials, self._calibration, self.settings, rng
        )

    def _choose_comparator(self) -> None:
        robot, trials = self.simulator.robot, self.known.trials
        self._comparator = self.choose_comparator(robot, trials)
        self.on_event(self._comparator)
        self._search = DiagnosticSearch(
            self.simulator,
            self._comparator.comparator,
            self.settings,
            self.kinds,
            healthy_trials=trials[:1],
            calibrate=self.calibrate,
        )

    def _diagnose(self) -> None:
        """Explains all trials since the failure; the last hypotheses seed the search."""
        self.on_event(SearchBegins("diagnostic"))
        number, known = len(self.known.diagnoses) + 1, self.known
        rng = random_stream(self.seed, "diagnosis", number)
        diagnosis = self._search(known.evidence, known.hypotheses, rng, self.on_event)
        self.store_diagnosis(diagnosis)
        self.known = replace(known, diagnoses=(*known.diagnoses, diagnosis))
        self.rng = random_stream(self.seed, "choice", number)
        self.on_event(diagnosis)

    def _result(self) -> Recovery:
        trials, diagnoses = self.known.trials, self.known.diagnoses
        robot, best = self.simulator.robot, diagnoses[-1].best
        faults = [INTACT, *[best] * (len(trials) - 1)]  # the first trial is of the healthy robot
        return Recovery(
            trials=trials,
            tried=(INTACT, INTACT, *(diagnosis.best for diagnosis in diagnoses[:-1])),
            diagnosis=diagnoses[-1],
            repair_evaluations=sum(repair.evaluations for repair in self._repairs),
            diagnostic_evaluations=self._search.evaluations,
            distinct_hypotheses=self._search.distinct_hypotheses,
            comparator=self._comparator,
            calibration=self._calibration,
            score=self.score,
            predicted=tuple(self._predicted),
            scores=tuple(map(partial(self.score.of_trial, robot), faults, trials)),
            falls=tuple(map(partial(fall_of, robot), faults, trials)),
        )


NextTrial = Callable[[RecoveryLoop], Controller]
"""Chooses the controller of the next physical trial of a recovery."""


def diagnose_trials(
    trials: Sequence[Trial],
    diagnose: DiagnosticSearch,
    seed: int,
    on_event: Callable[[Event], None],
    after: Collection[int] | None = None,
) -> Diagnosis:
    """Returns the diagnosis of logged trials, trial by trial as in a recovery.

    The best hypotheses of each diagnosis seed the next search. The trials and the seed of
    a recovery therefore reproduce the recovery's rankings.

    Args:
        trials: Trials since the failure, in the order in which they were run; at least one.
        diagnose: Diagnostic EA.
        seed: Seed of all random choices.
        on_event: Callback, called with each event as it happens.
        after: Numbers of trials after which to diagnose, including the number of all trials; after
            each trial, if not given.
    """
    if not trials:
        raise InputError("expected at least one trial to explain, got none")
    known = Database()
    for number in range(1, len(trials) + 1) if after is None else sorted(after):
        on_event(SearchBegins("diagnostic"))
        rng = random_stream(seed, "diagnosis", number)
        diagnosis = diagnose(trials[:number], known.hypotheses, rng, on_event)
        known = Database(diagnoses=(diagnosis,))
        on_event(diagnosis)
    return diagnosis


Purpose = Literal["repair", "diagnosis", "choice", "posterior", "gap"]


def random_stream(seed: int, purpose: Purpose, number: int = 0) -> np.random.Generator:
    """Returns one of the independent random number streams of a recovery, one per search.

    The draws of a search do not affect the other streams, so each search can be repeated alone.

    Args:
        seed: Seed of the recovery.
        purpose: A repair (number 0 evolves the gait, 1 follows the first diagnosis), a diagnosis
            (from 1), the choice of the trial after a diagnosis, the sample of models that trials
            weight, or the reality gap of a simulated physical robot.
        number: Number of the search.
    """
    keys = {
        "repair": 2 * number,
        "diagnosis": 2 * number - 1,
        "choice": 2**30 + number,  # above the keys of any number of searches
        "posterior": 2**31 - 1,
        "gap": 2**31,
    }
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(keys[purpose],)))
