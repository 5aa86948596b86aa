"""The paper's algorithm: run and log a trial, diagnose, repair, with few physical trials.

``RecoveryLoop.run`` is the whole of it, in order.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol, TypeVar

import numpy as np

from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.diagnosis.choice import ChosenComparator, ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.falls import fall_of
from selfmodel.recovery.random_streams import (
    choice_stream,
    diagnosis_stream,
    posterior_stream,
    repair_stream,
)
from selfmodel.recovery.repair import CandidateController, MakeRepair, mutants
from selfmodel.recovery.result import Database, Recovery
from selfmodel.recovery.robust_repair import RobustRepair
from selfmodel.recovery.scores import UPRIGHT, Score
from selfmodel.recovery.uncertainty import Posterior, assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Stage, Trial, TrialPlan

Value = TypeVar("Value")

RunTrial = Callable[[PhysicalRobot, TrialPlan], Trial]
"""Runs a physical trial and returns it; with a log, as read back from the log."""


class Journal(Protocol):
    """Storage of the diagnoses of a recovery; ``RunTrial`` stores its trials."""

    def add(self, diagnosis: Diagnosis) -> None:
        """Stores a diagnosis after the earlier ones."""
        ...


def by_repair(loop: "RecoveryLoop") -> Controller:
    """Returns the best candidate of the repair that was not tried yet.

    If all candidates were tried, a mutant of the best one is returned.
    """
    found = [candidate.controller for candidate in loop.repaired()]
    tried = loop.known.controllers
    untried = [controller for controller in found if controller not in tried]
    return (untried or untried_mutants(found[:1], tried, loop.settings, loop.rng))[0]


@dataclass(kw_only=True, eq=False)
class RecoveryLoop:
    """A recovery of a robot: its parts, and its state while it runs.

    Attributes:
        simulator: Self-model; after the calibration, the calibrated one.
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
        known: Trials and diagnoses so far; while a trial is chosen, the last diagnosis is of all
            trials.
        trials_left: Number of trials that remain, including the one that is chosen.
        rng: Random number generator of the choice of a trial.
    """

    simulator: Simulator
    choose_comparator: ComparatorChoice
    run_trial: RunTrial
    journal: Journal
    settings: Settings
    seed: int
    on_event: Callable[[Event], None]
    gait: Controller | None = None
    design: Design | None = None
    kinds: Sequence[FaultKind] = DEFAULT_KINDS
    calibrate: Callable[[Sequence[Trial]], Calibration] | None = None
    next_trial: Callable[["RecoveryLoop"], Controller] = by_repair
    score: Score = UPRIGHT
    make_repair: MakeRepair = RobustRepair
    known: Database = field(default_factory=Database, init=False)
    trials_left: int = field(default=0, init=False)
    rng: np.random.Generator = field(init=False)

    def run(self, healthy: PhysicalRobot, damaged: PhysicalRobot) -> Recovery:
        """Runs the recovery, once: a healthy trial, a failing one, then diagnosis and repair.

        Args:
            healthy: Physical robot before the failure.
            damaged: Physical robot after the failure.

        Returns:
            The trials, the last diagnosis and the number of evaluations.
        """
        HypothesisSpace.of(self.kinds, self.simulator.robot.anatomy)  # before any physical trial
        self._prepare_repair()
        gait = self.gait or self.evolved((INTACT,), self._assumed)[0].controller
        self._run_trial(healthy, "before", gait)
        self._calibrate()
        self._run_trial(damaged, "after", gait)
        self._choose_comparator()
        self.trials_left = self.settings.trials
        while self.trials_left:
            self._diagnose()
            self._run_trial(damaged, "recovery", self.next_trial(self))
            self.trials_left -= 1
        self._diagnose()
        return self._result()

    def repaired(self) -> tuple[CandidateController, ...]:
        """Evolves controllers that compensate for the last diagnosis; returns them best first."""
        diagnosis = self.known.diagnoses[-1]
        uncertainty = partial(self._posterior.after, self.known.trials, diagnosis.best)
        return self.evolved((diagnosis.best, *diagnosis.indistinguishable), uncertainty)

    def evolved(
        self, hypotheses: Sequence[Hypothesis], uncertainty: Callable[[], DomainDistribution]
    ) -> tuple[CandidateController, ...]:
        """Evolves controllers for hypotheses; returns them best first."""
        self.on_event(SearchBegins("repair", hypotheses[0]))
        rng = repair_stream(self.seed, len(self.known.diagnoses))
        found = self._repair(hypotheses, uncertainty, self.known.controllers, rng, self.on_event)
        self._predictions.update({one.controller: one.predicted for one in found})
        return found

    def _assumed(self) -> DomainDistribution:
        return assumed_uncertainty(self.simulator.robot)

    def _prepare_repair(self) -> None:
        self._tried: list[Hypothesis] = []
        self._predictions: dict[Controller, float] = {}
        self._predicted: list[float] = []
        self._repair_evaluations = 0
        # From the nominal robot: the numbers of the calibrated model are rounded.
        self._design = self.design or network_for(self.simulator.robot)
        self._repair = self.make_repair(self.simulator, self.settings, self._design, self.score)

    def _run_trial(self, robot: PhysicalRobot, stage: Stage, controller: Controller) -> None:
        number, settings = len(self.known.trials), self.settings
        plan = TrialPlan(f"{number:02d}-{stage}", stage, controller, settings.steps, self.seed)
        diagnoses = self.known.diagnoses
        self._tried.append(diagnoses[-1].best if diagnoses else INTACT)
        predicted = math.nan if stage == "after" else self._predictions.get(controller, math.nan)
        self._predicted.append(predicted)
        trial = self.run_trial(robot, plan)
        self.known = self.known.with_trial(trial)
        self.on_event(trial)

    def _calibrate(self) -> None:
        """Fits the self-model to the healthy trials, and begins a repair with the fitted one."""
        healthy_trials, nominal = self.known.trials, self.simulator
        self.choose_comparator(nominal.robot, healthy_trials)  # raises before the failure
        self._calibration = self.calibrate(healthy_trials) if self.calibrate else None
        if self._calibration is not None:
            self.on_event(self._calibration)
            if self._calibration.robot is not nominal.robot:
                fitted = self._calibration.robot
                self.simulator = Simulator(fitted, nominal.threads, nominal.stats)
                self._repair_evaluations = self._repair.evaluations
                self._repair = self.make_repair(
                    self.simulator, self.settings, self._design, self.score
                )
        self._posterior = Posterior(
            self.simulator,
            healthy_trials,
            self._calibration,
            self.settings,
            posterior_stream(self.seed),
        )

    def _choose_comparator(self) -> None:
        self._comparator: ChosenComparator = self.choose_comparator(
            self.simulator.robot, self.known.trials
        )
        self.on_event(self._comparator)
        self._search = DiagnosticSearch(
            self.simulator,
            self._comparator.comparator,
            self.settings,
            self.kinds,
            healthy_trials=self.known.trials[:1],
        )

    def _diagnose(self) -> None:
        self.on_event(SearchBegins("diagnostic"))
        number, known = len(self.known.diagnoses) + 1, self.known
        rng = diagnosis_stream(self.seed, number)
        diagnosis = self._search(known.evidence, known.hypotheses, rng, self.on_event)
        self.journal.add(diagnosis)
        self.known = known.with_diagnosis(diagnosis)
        self.rng = choice_stream(self.seed, number)
        self.on_event(diagnosis)

    def _result(self) -> Recovery:
        known, robot = self.known, self.simulator.robot
        return Recovery(
            trials=known.trials,
            tried=tuple(self._tried),
            diagnosis=known.diagnoses[-1],
            repair_evaluations=self._repair_evaluations + self._repair.evaluations,
            diagnostic_evaluations=self._search.evaluations,
            distinct_hypotheses=self._search.distinct_hypotheses,
            comparator=self._comparator,
            calibration=self._calibration,
            score=self.score,
            predicted=tuple(self._predicted),
            scores=_of_trials(self.score.of_trial, robot, known),
            falls=_of_trials(fall_of, robot, known),
        )


NextTrial = Callable[[RecoveryLoop], Controller]
"""Chooses the controller of the next physical trial of a recovery."""


def _of_trials(
    value: Callable[[Robot, Hypothesis, Trial], Value], robot: Robot, known: Database
) -> tuple[Value, ...]:
    """Returns a value of each trial under the last diagnosis; the first trial is healthy."""
    best = known.diagnoses[-1].best
    return tuple(
        value(robot, best if number else INTACT, trial) for number, trial in enumerate(known.trials)
    )


def untried_mutants(
    parents: Sequence[Controller],
    tried: Sequence[Controller],
    settings: Settings,
    rng: np.random.Generator,
) -> list[Controller]:
    """Returns one population of distinct mutants that were not tried, or a random controller.

    Args:
        parents: At least one controller, all of one design.
        tried: Controllers of earlier trials.
        settings: Numbers of the EA.
        rng: Random number generator of all random choices.
    """
    distinct = dict.fromkeys(mutants(parents, settings.population, settings, rng))
    found = [controller for controller in distinct if controller not in tried]
    # Every mutant may equal its parent, as without mutation.
    design = parents[0].design
    return found or [Controller(design, draw_genomes(rng, (design.weights,)))]


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
        trials: Trials since the failure, in the order in which they were run.
        diagnose: Diagnostic EA.
        seed: Seed of all random choices.
        on_event: Callback, called with each event as it happens.
        after: Numbers of trials after which to diagnose, including the number of all trials; after
            each trial, if not given.

    Raises:
        InputError: There are no trials, or a trial lacks signals that the comparator needs.
    """
    if not trials:
        raise InputError("expected at least one trial to explain, got none")
    diagnose.check(trials)
    known = Database()
    for number in range(1, len(trials) + 1) if after is None else sorted(after):
        on_event(SearchBegins("diagnostic"))
        rng = diagnosis_stream(seed, number)
        diagnosis = diagnose(trials[:number], known.hypotheses, rng, on_event)
        known = Database(diagnoses=(diagnosis,))
        on_event(diagnosis)
    return diagnosis
