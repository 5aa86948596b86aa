"""The paper's algorithm: run and log a trial, diagnose, repair, with few physical trials.

``RecoveryLoop.run`` is the whole of it, in order.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np

from selfmodel.controllers.controller import CommandSource, Controller, Design
from selfmodel.diagnosis.choice import ChosenComparator, ComparatorChoice
from selfmodel.diagnosis.diagnose import DiagnosticSearch, check_known
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import check_limit, still_trial
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery import repair as repairs
from selfmodel.recovery.candidates import CandidateController, Candidates
from selfmodel.recovery.falls import fall_of
from selfmodel.recovery.result import (
    Event,
    Recovery,
    Restored,
    SearchBegins,
    SelfModelWarning,
    TrialScore,
    advice,
    shortfall,
)
from selfmodel.recovery.scores import UPRIGHT, Score, check_measurable, observed_in, scores_of
from selfmodel.recovery.uncertainty import Posterior, assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import RepairSettings, Settings
from selfmodel.simulation.calibration import Calibration, Refit
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Stage, Trial, TrialPlan

SHORT_OF_BEFORE = 0.1
"""Share of the score before the failure that a robot with a controller of its own may lack in a
recovery trial that is the last one: each trial is a risk."""

RunTrial = Callable[[PhysicalRobot, TrialPlan], Trial]
"""Runs a physical trial and returns it; with a log, as read back from the log."""


FirstGait = Callable[[Callable[[], CandidateController]], CandidateController]
"""Returns the first gait of a robot, from a function that evolves it."""


def evolved(evolve: Callable[[], CandidateController]) -> CandidateController:
    """Returns the gait that is evolved now; a ``FirstGait``."""
    return evolve()


def by_repair(loop: "RecoveryLoop") -> Controller:
    """Returns the best candidate of the repair that was not tried yet, or else the best one.

    A repair around the controller of the robot leaves that of an intact robot as it is.
    """
    if loop.gait and loop.adapts_gait and loop.diagnoses[-1].verdict == "intact":
        return loop.gait
    candidates, tried = [each.controller for each in loop.repaired()], loop.controllers
    return next((one for one in candidates if one not in tried), candidates[0])


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
        ends_early: Whether a recovery ends with the first trial in which a robot that has a
            controller of its own walks as before.
        repair_settings: Those of the repair, in runs of the same length; None for the same.
        seed: Seed of all random choices.
        on_event: Callback, called with each event as it happens.
        gait: Controller of the robot before the failure; evolved if not given. The rest of the
            recovery does not depend on whether the same gait is evolved or given.
        first_gait: Returns that gait, evolved before or now; by default now.
        design: Design of the controllers to evolve; the paper's network if not given.
        kinds: Fault kinds that a diagnosis searches.
        hypothesis: Hypothesis that the first diagnosis begins from; ``INTACT`` if none is known.
        calibrate: Fits the self-model to the trials before the failure; no fit if not given.
        next_trial: Chooses the controller of each trial after the failing one.
        score: Fitness of the repair.
        make_repair: Makes the repair, which evolves the controllers.
        trials: Trials so far, the first one before the failure.
        diagnoses: Diagnoses so far; while a trial is chosen, the last one is of all trials.
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
    first_gait: FirstGait = evolved
    design: Design | None = None
    kinds: Sequence[FaultKind] = DEFAULT_KINDS
    hypothesis: Hypothesis = INTACT
    calibrate: Callable[[Sequence[Trial]], Calibration] | None = None
    next_trial: Callable[["RecoveryLoop"], Controller] = by_repair
    score: Score = UPRIGHT
    make_repair: repairs.MakeRepair = repairs.RobustRepair
    repair_settings: RepairSettings | None = None
    ends_early: bool = True
    trials: tuple[Trial, ...] = field(default=(), init=False)
    diagnoses: tuple[Diagnosis, ...] = field(default=(), init=False)
    trials_left: int = field(default=0, init=False)
    rng: np.random.Generator = field(init=False)

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """Distinct controllers that the physical robot has run, newest first."""
        drivers = dict.fromkeys(trial.plan.controller for trial in reversed(self.trials))
        return tuple(driver for driver in drivers if isinstance(driver, Controller))

    def run(self, healthy: PhysicalRobot, damaged: PhysicalRobot) -> Recovery:
        """Runs the recovery, once, with a robot before its failure and after it.

        The robot walks with a gait that was given or is evolved in simulation, and the self-model
        is fitted to the log. It fails, and the same gait is logged again. Both logs choose the
        comparator. Then diagnosis and trial alternate: the diagnosis explains all logs since the
        failure, and the next trial tries a controller that the repair evolved in simulation for
        the diagnosed robot (``repaired``), until there were as many as the settings allow, or a
        robot with a controller of its own walks as before. The last diagnosis is of all trials.
        """
        robot = self.simulator.robot
        HypothesisSpace.of(self.kinds, robot.anatomy)  # refused before any trial
        check_known(self.hypothesis, self.settings)
        if (limit := self.settings.max_simulated_steps) is not None:
            still = still_trial(robot, self.settings.steps)
            check_limit(limit, self.choose_comparator, still, robot)
        # From the nominal robot: the numbers of the calibrated model are rounded.
        self._design = self.design or network_for(robot)
        self._repairs: list[repairs.Repair] = []
        self._make_repair()
        self._means: dict[Controller, float] = {}
        self._predicted: list[float] = []
        self._robust_means: list[float] = []
        self._scored: tuple[TrialScore, ...] = ()
        self._warnings: list[str] = []
        gait = self.gait or self._first_gait()
        self._log_trial(healthy, "before", gait)
        calibration = self._fit_self_model()
        self._log_trial(damaged, "after", gait)
        comparator = self.choose_comparator(self.simulator.robot, self.trials)
        self.on_event(comparator)
        search = DiagnosticSearch(
            *(self.simulator, comparator.comparator, self.settings, self.kinds),
            healthy_trials=self.trials[:1],
            refit=Refit(robot, calibration, self.simulator.threads, self.on_event)
            if calibration
            else None,
        )
        self._diagnose(search)
        for left in range(self.settings.trials, 0, -1):
            self.trials_left = left
            controller = self.next_trial(self)  # by default ``by_repair``: the best of ``repaired``
            self._log_trial(damaged, "recovery", controller)
            self._diagnose(search)
            if left > 1 and self._is_restored:
                self.on_event(Restored())
                break
        return self._result(comparator, calibration, search)

    def _first_gait(self) -> Controller:
        """Returns the gait of the robot before the failure, evolved now or before."""
        assumed = partial(assumed_uncertainty, self.simulator.robot)
        first = self.first_gait(lambda: self._evolved((INTACT,), assumed)[0])
        self._means[first.controller] = first.mean
        return first.controller

    def repaired(self) -> Candidates:
        """Evolves controllers that compensate for the last diagnosis; returns them best first.

        They are those up to the first that was not tried before.
        """
        diagnosis = self.diagnoses[-1]
        uncertainty = partial(self._posterior.after, self.trials, diagnosis.best)
        return self._evolved((diagnosis.best, *diagnosis.indistinguishable), uncertainty)

    @property
    def adapts_gait(self) -> bool:
        """Whether the repair changes the controller of the robot; see ``Repair``."""
        return self._repairs[-1].adapts_gait

    @property
    def _is_restored(self) -> bool:
        """Whether the robot walked as before in the last trial, by an adapted controller."""
        before, last = self._scored[0].value, self._scored[-1]
        is_as_before = last.fall is None and before - last.value <= SHORT_OF_BEFORE * abs(before)
        return self.ends_early and self.adapts_gait and is_as_before

    def _make_repair(self) -> None:
        """Makes the repair of the self-model."""
        self._repaired_robot = self.simulator.robot
        settings = self.settings.of_repair(self.repair_settings)
        repair = self.make_repair(self.simulator, settings, self._design, self.score)
        self._repairs.append(repair)

    def _evolved(
        self, hypotheses: Sequence[Hypothesis], uncertainty: Callable[[], DomainDistribution]
    ) -> Candidates:
        """Evolves controllers for hypotheses, best first; returns them best first."""
        self.on_event(SearchBegins("repair", hypotheses[0]))
        rng = random_stream(self.seed, "repair", len(self.diagnoses))
        repair, robot = self._repairs[-1], self.simulator.robot
        candidates = repair(hypotheses, uncertainty, self.controllers, rng, self.on_event)
        self._means.update({each.controller: each.mean for each in candidates})
        if (parts := candidates[0].parts) > 1 and self._repaired_robot is robot:
            self._repaired_robot = robot.finer(parts)
            self._warn(
                f"every finalist of the repair for {hypotheses[0]} lost more than a fifth of its "
                f"score at a quarter of the physics time step: the self-model flatters. Repairs "
                f"have that time step from now on; {advice(robot)}"
            )
        return candidates

    def _warn(self, text: str) -> None:
        self._warnings.append(text)
        self.on_event(SelfModelWarning(text))

    def _log_trial(self, robot: PhysicalRobot, stage: Stage, controller: Controller) -> None:
        foreseen = stage != "after"
        model = self._repaired_robot
        predicted = self._simulated_score(controller, model) if foreseen else math.nan
        self._predicted.append(predicted)
        mean = self._means.get(controller, math.nan) if foreseen else math.nan
        self._robust_means.append(mean)
        name = f"{len(self.trials):02d}-{stage}"
        plan = TrialPlan(name, stage, controller, self.settings.steps, self.seed)
        trial = self.run_trial(robot, plan)
        self.trials = (*self.trials, trial)
        self.on_event(trial)

    def _simulated_score(self, controller: CommandSource, robot: Robot) -> float:
        """Returns the score of one simulation of a robot, without noise; NaN if it diverges.

        Its hypothesis is the best so far. The simulation is no cost of a search.
        """
        best = self._best_so_far
        runs = Simulator(robot, threads=1).run(
            [(best, controller)], self.settings.steps, self.score.record
        )
        (value,) = scores_of(self.score, robot, [best], runs.grouped(1, 1))[0]
        return float(value) if math.isfinite(value) else math.nan

    @property
    def _best_so_far(self) -> Hypothesis:
        return self.diagnoses[-1].best if self.diagnoses else INTACT

    def _score_trials(self) -> None:
        """Scores each trial by the best hypothesis so far; what is new or changes is an event."""
        robot, scored = self.simulator.robot, list[TrialScore]()
        for number, trial in enumerate(self.trials):
            known = self._scored[number] if number < len(self._scored) else None
            # The first trial is of the healthy robot.
            hypothesis = self._best_so_far if number else INTACT
            if known is None or known.hypothesis != hypothesis:
                value = self.score.of_trial(robot, hypothesis, trial)
                fall = fall_of(robot, hypothesis, trial)
                before, known = known, TrialScore(trial, hypothesis, self.score, value, fall)
                if before is None or (before.value, before.fall) != (value, fall):
                    self.on_event(known)
                if before is None:
                    self._warn_of_shortfall(number, known)
            scored.append(known)
        self._scored = tuple(scored)

    def _warn_of_shortfall(self, number: int, found: TrialScore) -> None:
        """Warns of a new trial with less than half of the score that was predicted."""
        predicted = float(np.fmin(self._robust_means[number], self._predicted[number]))
        tried = self.diagnoses[number - 2].best if number > 1 else found.hypothesis
        simulated = partial(self._simulated_score, found.trial.plan.controller)
        text = shortfall(found, predicted, tried, self._repaired_robot, simulated)
        if text is not None:
            self._warn(text)

    def _fit_self_model(self) -> Calibration | None:
        """Fits the self-model to the healthy trials; a new repair simulates the fitted one."""
        healthy_trials, nominal = self.trials, self.simulator
        # Refused before the failure.
        check_measurable(self.score, nominal.robot, observed_in(healthy_trials[0]))
        choose, limit = self.choose_comparator, self.settings.max_simulated_steps
        choose(nominal.robot, healthy_trials)
        check_limit(limit, choose, healthy_trials[0], nominal.robot)
        calibration = self.calibrate(healthy_trials) if self.calibrate else None
        if calibration is not None:
            self.on_event(calibration)
            if calibration.robot is not nominal.robot:
                self.simulator = Simulator(calibration.robot, nominal.threads, nominal.stats)
                self._make_repair()
        rng = random_stream(self.seed, "posterior")
        settings = self.settings.of_repair(self.repair_settings)
        self._posterior = Posterior(self.simulator, healthy_trials, calibration, settings, rng)
        self._score_trials()
        return calibration

    def _diagnose(self, search: DiagnosticSearch) -> None:
        """Explains all trials since the failure; the last hypotheses seed the search."""
        evidence = self.trials[1:]
        known = _known(self.diagnoses, self.hypothesis)
        diagnosis = _diagnosed(search, evidence, known, self.seed, self.on_event)
        self.store_diagnosis(diagnosis)
        self.diagnoses = (*self.diagnoses, diagnosis)
        self.rng = random_stream(self.seed, "choice", len(self.diagnoses))
        self.on_event(diagnosis)
        self._score_trials()

    def _result(
        self,
        comparator: ChosenComparator,
        calibration: Calibration | None,
        search: DiagnosticSearch,
    ) -> Recovery:
        return Recovery(
            trials=self.trials,
            tried=(INTACT, INTACT, *(diagnosis.best for diagnosis in self.diagnoses[:-1])),
            diagnosis=self.diagnoses[-1],
            repair_evaluations=sum(repair.evaluations for repair in self._repairs),
            diagnostic_evaluations=search.evaluations,
            distinct_hypotheses=search.distinct_hypotheses,
            comparator=comparator,
            calibration=calibration,
            score=self.score,
            predicted=tuple(self._predicted),
            robust_means=tuple(self._robust_means),
            scored=self._scored,
            warnings=tuple(self._warnings),
        )


NextTrial = Callable[[RecoveryLoop], Controller]
"""Chooses the controller of the next physical trial of a recovery."""


def diagnose_trials(
    trials: Sequence[Trial],
    diagnose: DiagnosticSearch,
    seed: int,
    on_event: Callable[[Event], None],
    *,
    after: Collection[int] | None = None,
    hypothesis: Hypothesis = INTACT,
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
        hypothesis: Hypothesis that the first diagnosis begins from; ``INTACT`` if none is known.
    """
    diagnoses: tuple[Diagnosis, ...] = ()
    for number in range(1, len(trials) + 1) if after is None else sorted(after):
        known = _known(diagnoses, hypothesis)
        diagnoses = (_diagnosed(diagnose, trials[:number], known, seed, on_event),)
        on_event(diagnoses[-1])
    return diagnoses[-1]


def _known(diagnoses: Sequence[Diagnosis], hypothesis: Hypothesis) -> list[Hypothesis]:
    """Returns the hypotheses that a diagnosis begins from: those of the last one, or the first."""
    if diagnoses:
        return [each.hypothesis for each in diagnoses[-1].ranked]
    return [hypothesis] if len(hypothesis) else []


def _diagnosed(
    search: DiagnosticSearch,
    trials: Sequence[Trial],
    known: Sequence[Hypothesis],
    seed: int,
    on_event: Callable[[Event], None],
) -> Diagnosis:
    """Returns the diagnosis of trials; the search begins from known hypotheses."""
    on_event(SearchBegins("diagnostic"))
    rng = random_stream(seed, "diagnosis", len(trials))
    return search(trials, known, rng, on_event)


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
