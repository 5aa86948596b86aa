"""A recovery whose truth is known: what is hidden from the algorithm, and how well it did."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.experiments.fitting import fitted
from selfmodel.experiments.plugins import NEXT_TRIAL
from selfmodel.experiments.reality import draw_reality
from selfmodel.experiments.scoring import is_correct
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs.journal import create_journal
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.events import Event
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.recovery.recover import Recovery, recover
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.outcome import SimulationStats
from selfmodel.simulation.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Experiment:
    """What to run.

    Attributes:
        robot: The robot as its model describes it.
        case: Which failure of Table I it is, if it is one.
        truth: What goes wrong with the physical robot.
        comparator: Judges hypotheses by the logged trials.
        settings: The paper's numbers.
        seed: Every random choice comes from it.
        threads: Threads for the physics.
        folder: Where the run is kept.
        gait: How the robot walks before it fails; evolved if there is none.
        gap: How far the physical robot is from its model, a level.
        structure: Whether it is built differently, too.
        kinds: What a diagnosis considers.
        calibrated: Whether the self-model is fitted to the trials before the failure.
        next_trial: How each trial after the failing one is chosen, one of ``NEXT_TRIAL``.
        design: The kind of controller to evolve; the robot's network if none is given.
        score: What controllers are evolved for.
        physical: Makes the physical robot with something wrong, if it is more than a simulation of
            the model; it has no gap then.
    """

    robot: Robot
    case: int | None
    truth: Hypothesis
    comparator: Comparator
    settings: Settings
    seed: int
    threads: int
    folder: Path
    gait: Controller | None = None
    gap: float = 0.0
    structure: bool = False
    kinds: tuple[FaultKind, ...] = PAPER_KINDS
    calibrated: bool = True
    next_trial: str = "repair"
    design: Design | None = None
    score: Score = DISPLACEMENT
    physical: Callable[[Robot, Hypothesis], PhysicalRobot] | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of it.

    Attributes:
        recovery: How the recovery went.
        correct: Whether the diagnosis is right.
        stats: What the self-model simulated, up to the judgement.
        seconds: Wall time of the recovery.
    """

    recovery: Recovery
    correct: bool
    stats: SimulationStats
    seconds: float


def run(experiment: Experiment, on_event: Callable[[Event], None]) -> Outcome:
    """Runs an experiment; the algorithm gets physical robots and a journal, and no truth."""
    start = perf_counter()
    robot, truth = experiment.robot, experiment.truth
    simulator = Simulator(robot, experiment.threads)
    reality = draw_reality(robot, experiment.seed, experiment.gap, structure=experiment.structure)
    if experiment.physical is not None and reality.text is None:
        healthy, damaged = (experiment.physical(robot, hidden) for hidden in (INTACT, truth))
    else:
        healthy, damaged = reality.robot(robot), reality.robot(robot, truth, stream=1)
    journal = create_journal(experiment.folder, robot.anatomy, experiment.kinds)
    recovery = recover(
        healthy=healthy,
        damaged=damaged,
        simulator=simulator,
        comparator=experiment.comparator,
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
    )
    return Outcome(
        recovery=recovery,
        stats=simulator.stats,
        seconds=perf_counter() - start,
        correct=is_correct(
            recovery.diagnosis.best,
            truth,
            recovery.trials[1:],
            # Another simulator: judging is no part of what the recovery cost.
            Simulator(robot, experiment.threads),
        ),
    )
