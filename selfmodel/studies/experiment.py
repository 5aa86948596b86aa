"""Recovery in a folder, and that of a simulated robot with known faults: definition, score, run."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from msgspec import convert

from selfmodel import plugins
from selfmodel.arguments import fitted, read_logs
from selfmodel.arrays import finite_or_none
from selfmodel.controllers.controller import CommandSource, Controller, Design, draw_genomes
from selfmodel.diagnosis.choice import ComparatorChoice
from selfmodel.diagnosis.diagnosis import output_of
from selfmodel.diagnosis.text import summary
from selfmodel.errors import InputError, check_type
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.logs import results
from selfmodel.logs.journal import TRIALS, add_diagnosis, make_run
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.logs.recordings.recording import TABLE
from selfmodel.logs.recordings.tables import FORMATS, is_table, read_table
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.recovery.recover import (
    FirstGait,
    NextTrial,
    RecoveryLoop,
    evolved,
    random_stream,
)
from selfmodel.recovery.repair import MakeSearch
from selfmodel.recovery.repertoire import Repertoire, self_model_digest
from selfmodel.recovery.result import Event, Recovery
from selfmodel.recovery.scores import (
    TRACKING,
    UPRIGHT,
    VELOCITY,
    Score,
    check_measurable,
    observed_of,
    upright_within,
)
from selfmodel.recovery.tracking import Reference, following, tracking
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import RepairSettings, Settings
from selfmodel.simulation.reality_gap import RealityGap
from selfmodel.simulation.rollout import SimulationStats
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import Entry
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Stage, Trial

LEAST_MOTION = 0.02
"""Smallest motion of a joint that can be followed, rad."""

TIME = "time"
"""Name of the column of a table with the time of each row, s."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Definition of a recovery, of a simulated robot with known faults or of other robots.

    The fields of the same names are those of ``RecoveryLoop``.

    Attributes:
        case: Number of the failure in Table I; None for a failure that is not in it.
        truth: Faults of the simulated physical robot after the failure.
        gap: Level of its reality gap.
        entry: Its task, and its physical robot beyond a simulation of the model, which is unused
            with a reality gap; None for a robot without.
        calibrated: Whether the self-model is fitted to the trials before the failure.
        next_trial: Choice of each trial after the failing one; see ``plugins.next_trial``.
        repair: Name of the repair, such as ``robust``.
        search: Search of the repair; None for its own.
        repertoire: Gaits from which the search ``repertoire`` begins.
        repair_settings: Parameters of the repair; None for ``settings``.
    """

    robot: Robot
    choose_comparator: ComparatorChoice
    settings: Settings
    seed: int
    threads: int
    folder: Path
    case: int | None = None
    truth: Hypothesis = INTACT
    gap: float = 0.0
    entry: Entry | None = None
    gait: Controller | None = None
    first_gait: FirstGait = evolved
    kinds: tuple[FaultKind, ...] = DEFAULT_KINDS
    hypothesis: Hypothesis = INTACT
    calibrated: bool = True
    next_trial: NextTrial | str = "repair"
    design: Design | None = None
    score: Score = UPRIGHT
    repair: str = plugins.ROBUST
    search: MakeSearch | str | None = None
    repertoire: Repertoire | None = None
    repair_settings: RepairSettings | None = None
    ends_early: bool = True


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of an experiment: simulations of the self-model, and wall time, s, of the recovery.

    ``returns`` has the return of each trial, NaN for a robot without a task.
    """

    recovery: Recovery
    correct: bool
    returns: tuple[float, ...]
    stats: SimulationStats
    seconds: float


def run(experiment: Experiment, on_event: Callable[[Event], None]) -> Outcome:
    """Runs an experiment. The algorithm has access to the trials, not to the truth."""
    start, stats = perf_counter(), SimulationStats()
    robot, truth = experiment.robot, experiment.truth
    gap = draw_reality(robot, experiment.seed, experiment.gap)
    entry = experiment.entry or Entry(lambda: robot)
    healthy, damaged = (
        SimulatedRobot(robot, hidden, gap, stream)
        if entry.physical is None or gap.level
        else entry.physical(robot, hidden)
        for stream, hidden in enumerate((INTACT, truth))
    )
    recovery = run_recovery(
        *(experiment, healthy, damaged, on_event),
        stats=stats,
        hidden={"before": str(INTACT), "after": str(truth), "recovery": str(truth)},
        gap=gap.text,
    )
    seconds = perf_counter() - start
    judge = Simulator(robot, experiment.threads)  # scoring is no cost of the recovery
    correct = is_correct(recovery.diagnosis.best, truth, recovery.trials[1:], judge)
    task = entry.episode_return
    returns = recovery.scores_by(task, robot) if task else (math.nan,) * len(recovery.trials)
    return Outcome(recovery, correct, returns, stats, seconds)


def result_of(experiment: Experiment, outcome: Outcome) -> results.RecoveryResult:
    """Returns the outcome of an experiment as ``recover --json`` prints it."""
    recovery, stats, gaits = outcome.recovery, outcome.stats, experiment.repertoire
    design = experiment.design or network_for(experiment.robot)
    values = recovery.to_dict()
    return results.RecoveryResult(
        robot=experiment.robot.name,
        model=self_model_digest(experiment.robot),
        case=experiment.case,
        truth=str(experiment.truth),
        comparator=recovery.comparator.comparator.name,
        comparator_reason=recovery.comparator.reason,
        kinds=tuple(kind.name for kind in experiment.kinds),
        gap=experiment.gap,
        next_trial=plugins.name_of("next_trial", experiment.next_trial),
        repair=experiment.repair,
        search=plugins.search_name(experiment.repair, experiment.search, gaits),
        repertoire=asdict(gaits.origin) if gaits else None,
        controller=design.name,
        neurons=design.hidden,
        seed=experiment.seed,
        trials=tuple(
            convert({**row, "return": finite_or_none(reward)}, results.TrialResult)
            for row, reward in zip(values["trials"], outcome.returns, strict=True)
        ),
        **output_of(recovery.diagnosis),
        summary=" ".join(summary(recovery.diagnosis)),
        calibration=recovery.calibration.to_dict() if recovery.calibration else None,
        correct=outcome.correct,
        displacement=values["displacement"],
        score=results.ScoreResult(
            name=recovery.score.name,
            unit=recovery.score.unit,
            before=finite_or_none(recovery.scores[0]),
            after=finite_or_none(recovery.scores[1]),
            recovered=finite_or_none(recovery.best_score),
            most=recovery.score.most(experiment.settings.steps),
        ),
        fell=recovery.fell,
        recovery=recovery.recovery,
        physical_trials=len(recovery.trials) - 2,
        evaluations={
            **values["evaluations"],
            "simulated_steps": stats.steps,
            "diverged": stats.diverged,
        },
        warnings=recovery.warnings,
        seconds=outcome.seconds,
    )


def run_recovery(
    experiment: Experiment,
    healthy: PhysicalRobot,
    damaged: PhysicalRobot,
    on_event: Callable[[Event], None],
    *,
    stats: SimulationStats | None = None,
    hidden: Mapping[Stage, str] = MappingProxyType({}),
    gap: str | None = None,
) -> Recovery:
    """Runs a recovery of a robot before and after its failure; ``stats`` counts its simulations.

    What is wrong is refused before there is a folder. ``hidden`` and ``gap`` are for the logs; see
    ``TrialRunner``.
    """
    robot, settings, threads = experiment.robot, experiment.settings, experiment.threads
    check_measurable(experiment.score, robot, observed_of(healthy, damaged))
    make_repair = plugins.repair(experiment.repair, experiment.search, experiment.repertoire)
    next_trial, kinds = plugins.next_trial(experiment.next_trial), experiment.kinds
    calibrated, fit = (
        experiment.calibrated,
        partial(fitted, robot, threads=threads, observer=on_event),
    )
    make_run(folder := experiment.folder, calibrated=calibrated)
    return RecoveryLoop(
        simulator=Simulator(robot, threads, stats),
        choose_comparator=experiment.choose_comparator,
        run_trial=TrialRunner(folder / TRIALS, robot, settings, hidden=hidden, gap=gap),
        store_diagnosis=partial(add_diagnosis, folder),
        settings=settings,
        seed=experiment.seed,
        on_event=on_event,
        gait=experiment.gait,
        first_gait=experiment.first_gait,
        design=experiment.design,
        kinds=kinds,
        hypothesis=experiment.hypothesis,
        calibrate=fit if experiment.calibrated else None,
        next_trial=next_trial,
        score=experiment.score,
        make_repair=make_repair,
        repair_settings=experiment.repair_settings,
        ends_early=experiment.ends_early,
    ).run(healthy, damaged)


def draw_reality(robot: Robot, seed: int, level: float) -> RealityGap:
    """Returns the gap of a physical robot; a search with the same seed draws other numbers."""
    return draw_gap(robot, level, random_stream(seed, "gap"))


def is_correct(
    best: Hypothesis, truth: Hypothesis, trials: Sequence[Trial], simulator: Simulator
) -> bool:
    """Returns whether a hypothesis is the truth, or behaves like the truth in all trials.

    Two hypotheses, in canonical form, behave alike if all signals of their simulations are the same
    to the bit under the controller of every trial.
    """

    def alike(trial: Trial) -> bool:
        runs = [(one, trial.plan.controller) for one in (best, truth)]
        trajectory = simulator.run(runs, trial.trajectory.steps, SIGNALS).trajectory
        return all(np.array_equal(*trajectory[signal]) for signal in SIGNALS)

    return best == truth or all(map(alike, trials))


class ChosenScore(NamedTuple):
    """Fitness of a repair, and the controller whose motion is to be followed, if that is needed."""

    score: Score
    gait: Controller | None = None


def choose_score(
    name: Score | str,
    entry: Entry,
    design: Design,
    *,
    steps: int,
    seed: int,
    reference: Path | None = None,
    gait: Controller | None = None,
    max_speed: float | None = None,
    max_torque: float | None = None,
    max_self_collision: float | None = None,
) -> ChosenScore:
    """Returns the score of that name for a robot.

    Args:
        name: A name of ``SCORES``, ``return``, ``tracking``, ``velocity``, a score, or an entry
            point in the group ``selfmodel.scores``, or ``package.module:object``.
        entry: The robot.
        design: Design of the controllers.
        steps: Control steps of a trial.
        seed: Seed of all random numbers of the recovery.
        reference: File of the trajectory to follow; None for the motion of the first controller in
            simulation.
        gait: The first controller; None for one with random weights if its motion is needed.
        max_speed: Largest speed of a joint, rad/s.
        max_torque: Largest torque of a joint, N m.
        max_self_collision: Largest depth to which two bodies penetrate each other, m.

    Raises:
        InputError: The name is unknown or the robot has no such score, a reference or a limit is
            given for another score, a limit is out of range, or the motion of the first controller
            stops.
    """
    robot = entry.robot()
    check_type(name, Score | str, 'a Score or its name, such as "energy"')
    if isinstance(name, Score):
        check_measurable(name, robot)
        return ChosenScore(name, gait)
    commanded = gait.design.velocity if gait is not None and name == VELOCITY else None
    if commanded is None:
        check_score(name, entry)
    if reference is not None and name != TRACKING:
        raise InputError(f"--reference is a trajectory for --score {TRACKING}, got {name}")
    limits = (max_speed, max_torque, max_self_collision)
    if any(limit is not None for limit in limits):
        return ChosenScore(_limited(name, limits), gait)
    if commanded is not None:
        check_measurable(score := following(commanded), robot)
        return ChosenScore(score, gait)
    if name != TRACKING:
        return ChosenScore(plugins.score(name, robot.name, entry), gait)
    if reference is not None:
        return ChosenScore(tracking(read_reference(reference, robot), robot), gait)
    random = Controller(design, draw_genomes(random_stream(seed, "repair"), (design.weights,)))
    motion = simulated_reference(robot, first := gait or random, steps)
    # A pose that is reached is nothing to follow.
    if np.ptp(motion.positions[len(motion.time) // 2 :], axis=0).max() < LEAST_MOTION:
        raise InputError(
            "the first controller, which has random weights, moves the joints into a pose and "
            "stops, so there is no motion to follow: give --controller cpg, whose motion goes on, "
            "another --seed, or --reference FILE"
        )
    return ChosenScore(tracking(motion, robot), first)


def _limited(name: str, limits: Sequence[float | None]) -> Score:
    """Returns the score ``upright`` with limits of speed, torque and depth; None for no limit."""
    options = ("--max-joint-speed", "--max-joint-torque", "--max-self-collision")
    if name != UPRIGHT.name:
        raise InputError(
            f"{', '.join(options)} are limits of --score {UPRIGHT.name}, got {name}: leave them out"
        )
    ranges = ("above 0 rad/s", "above 0 N m", "of 0 m or above")
    for option, allowed, limit in zip(options, ranges, limits, strict=True):
        if limit is not None and not (limit > 0 or (limit == 0 and "or above" in allowed)):
            raise InputError(
                f"expected {option} {allowed}, got {limit:g}: give the largest value that is "
                f"allowed, or leave the option out"
            )
    return upright_within(*(math.inf if limit is None else limit for limit in limits))


def check_score(name: str, entry: Entry) -> None:
    """Checks that a robot has a score of that name, which can be measured on it."""
    if name != TRACKING:
        robot = entry.robot()
        check_measurable(plugins.score(name, robot.name, entry), robot)


def read_reference(path: Path, robot: Robot) -> Reference:
    """Returns the reference trajectory in a file, which begins at time 0.

    Args:
        path: A trial's log, or a table with a column ``time``, s, and columns with the names of
            hinges, rad. Other columns are ignored.
        robot: The robot that is to follow the trajectory.
    """
    if path.suffix.lower() == ".mcap":
        (log,) = read_logs([path])
        trajectory = log.trial.trajectory
        seen = np.isfinite(trajectory["joint_positions"])
        columns = np.flatnonzero(seen.any(axis=0))
        rows = seen[:, columns].all(axis=1)
        hinges = tuple(trajectory.names.hinges[column] for column in columns)
        time, positions = trajectory.time[rows], trajectory["joint_positions"][rows][:, columns]
    elif is_table(path):
        table = read_table(path, (TIME, *robot.anatomy.hinges)).series[TABLE]
        hinges = tuple(name for name in robot.anatomy.hinges if name in table.columns)
        if TIME not in table.columns or not hinges:
            raise InputError(
                f"{path}: expected a column {TIME} and columns with names of joints of "
                f"{robot.name} ({', '.join(robot.anatomy.hinges)}), got "
                f"{', '.join(table.names) or 'none'}: rename its columns"
            )
        time = table.columns[TIME].values[:, 0]
        positions = np.concatenate([table.columns[name].values for name in hinges], axis=1)
    else:
        raise InputError(
            f"{path}: expected a log (.mcap) or a table ({', '.join(FORMATS)}) as reference"
        )
    try:
        return Reference(hinges, time - time[:1], positions)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def simulated_reference(robot: Robot, driver: CommandSource, steps: int) -> Reference:
    """Returns the joint trajectory of a controller of the healthy robot in simulation."""
    run = Simulator(robot, threads=1).run([(INTACT, driver)], steps, ["joint_positions"]).trajectory
    return Reference(run.names.hinges, run.time, run["joint_positions"][0])
