"""Recovery of a simulated physical robot with known faults: definition, run, correctness."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from selfmodel.arguments import fitted
from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.choice import ComparatorChoice
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.logs.journal import create_journal
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.plugins import NEXT_TRIAL, PAPER, repair
from selfmodel.recovery.recover import RecoveryLoop, random_stream
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.result import Event, Recovery
from selfmodel.recovery.scores import DISPLACEMENT, Score
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.model_factors import with_model
from selfmodel.simulation.reality_gap import RealityGap, perturbed_model
from selfmodel.simulation.rollout import SimulationStats
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class Experiment:
    """Definition of a recovery with known truth.

    Attributes:
        robot: The nominal robot.
        case: Number of the failure in Table I; None for a failure that is not in it.
        truth: Faults of the physical robot after the failure.
        choose_comparator: Chooses the comparator from the first trials.
        settings: Parameters of the recovery.
        seed: Seed of all random numbers.
        threads: Number of threads of the physics.
        folder: Folder of the run.
        gait: Controller before the failure; None to evolve one.
        gap: Level of the reality gap.
        kinds: Fault kinds to search.
        calibrated: Whether the self-model is fitted to the trials before the failure.
        next_trial: Choice of each trial after the failing one, one of ``NEXT_TRIAL``.
        design: Controller design; None for the robot's network.
        score: Fitness of the repair.
        repair: Name of the repair, ``robust`` or ``paper``.
        search: Name of the search of the repair; None for its own.
        repertoire: Gaits from which the search ``repertoire`` begins.
        physical: Returns the physical robot with a hypothesis, for robots beyond a simulation of
            the model; unused with a reality gap.
    """

    robot: Robot
    case: int | None
    truth: Hypothesis
    choose_comparator: ComparatorChoice
    settings: Settings
    seed: int
    threads: int
    folder: Path
    gait: Controller | None = None
    gap: float = 0.0
    kinds: tuple[FaultKind, ...] = DEFAULT_KINDS
    calibrated: bool = True
    next_trial: str = "repair"
    design: Design | None = None
    score: Score = DISPLACEMENT
    physical: Callable[[Robot, Hypothesis], PhysicalRobot] | None = None
    repair: str = PAPER
    search: str | None = None
    repertoire: Repertoire | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of an experiment.

    Attributes:
        recovery: The recovery.
        correct: Whether the last diagnosis is right.
        stats: Simulations of the self-model during the recovery.
        seconds: Wall time of the recovery, s.
    """

    recovery: Recovery
    correct: bool
    stats: SimulationStats
    seconds: float


def run(experiment: Experiment, on_event: Callable[[Event], None]) -> Outcome:
    """Runs an experiment. The algorithm has access to the trials, not to the truth."""
    start = perf_counter()
    robot, truth = experiment.robot, experiment.truth
    simulator = Simulator(robot, experiment.threads)
    reality = draw_reality(robot, experiment.seed, experiment.gap)
    if experiment.physical is not None and reality.text is None:
        healthy, damaged = (experiment.physical(robot, hidden) for hidden in (INTACT, truth))
    else:
        healthy, damaged = reality.robot(robot), reality.robot(robot, truth, stream=1)
    journal = create_journal(
        experiment.folder, robot.anatomy, experiment.kinds, calibrated=experiment.calibrated
    )
    recovery = RecoveryLoop(
        simulator=simulator,
        choose_comparator=experiment.choose_comparator,
        run_trial=TrialRunner(
            journal.trials,
            robot,
            experiment.settings,
            hidden={"before": str(INTACT), "after": str(truth), "recovery": str(truth)},
            gap=reality.text,
        ),
        journal=journal,
        settings=experiment.settings,
        seed=experiment.seed,
        on_event=on_event,
        gait=experiment.gait,
        design=experiment.design,
        kinds=experiment.kinds,
        calibrate=partial(fitted, robot, threads=experiment.threads)
        if experiment.calibrated
        else None,
        next_trial=NEXT_TRIAL[experiment.next_trial],
        score=experiment.score,
        make_repair=repair(experiment.repair, experiment.search, experiment.repertoire),
    ).run(healthy, damaged)
    return Outcome(
        recovery=recovery,
        stats=simulator.stats,
        seconds=perf_counter() - start,
        correct=is_correct(
            recovery.diagnosis.best,
            truth,
            recovery.trials[1:],
            # A separate simulator: scoring does not count as cost of the recovery.
            Simulator(robot, experiment.threads),
        ),
    )


@dataclass(frozen=True)
class Reality:
    """Difference between a physical robot and its model, apart from faults.

    Attributes:
        gap: The reality gap; level 0 is none.
    """

    gap: RealityGap

    @property
    def text(self) -> str | None:
        """Hidden record of a trial log, as JSON; None if the robot equals its model."""
        if self.gap.level == 0:
            return None
        return json.dumps({**self.gap.as_dict(), "structure": None}, allow_nan=False)

    def hidden_model(self, robot: Robot) -> Robot:
        """Returns a robot whose model has the factors and the delay of the gap, for an oracle."""
        model = perturbed_model(robot.model, self.gap)
        return with_model(robot, model, robot.control_delay + self.gap.delay)

    def robot(self, robot: Robot, hidden: Hypothesis = INTACT, stream: int = 0) -> SimulatedRobot:
        """Returns the physical robot with hidden faults; see ``SimulatedRobot``."""
        return SimulatedRobot(robot, hidden, self.gap, stream)


def draw_reality(robot: Robot, seed: int, level: float) -> Reality:
    """Returns the reality gap of a physical robot.

    Args:
        robot: The nominal robot.
        seed: Seed; a search with the same seed draws other numbers.
        level: Level of the reality gap.

    Raises:
        InputError: The level is out of range.
    """
    return Reality(draw_gap(robot, level, random_stream(seed, "gap")))


def is_correct(
    best: Hypothesis, truth: Hypothesis, trials: Sequence[Trial], simulator: Simulator
) -> bool:
    """Returns whether a hypothesis is the truth, or behaves like the truth in all trials.

    Two hypotheses behave alike if all signals of their simulations are the same to the bit under
    the controller of every trial.

    Args:
        best: Best hypothesis of a diagnosis, in canonical form.
        truth: Hypothesis of the physical robot, in canonical form.
        trials: Trials that the diagnosis explains.
        simulator: Self-model.
    """
    return best == truth or all(_same_bits(best, truth, trial, simulator) for trial in trials)


def _same_bits(best: Hypothesis, truth: Hypothesis, trial: Trial, simulator: Simulator) -> bool:
    controller = trial.plan.controller
    runs = [(best, controller), (truth, controller)]
    behaviour = simulator.run(runs, trial.behaviour.steps, SIGNALS).behaviour
    return all(np.array_equal(*behaviour[signal]) for signal in SIGNALS)
