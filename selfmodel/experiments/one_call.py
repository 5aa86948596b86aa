"""The public functions: one call from names and files to a result."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from selfmodel.comparators import DEFAULT
from selfmodel.controllers.command_source import CommandSource
from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.experiments import plugins
from selfmodel.experiments.fitting import fitted
from selfmodel.experiments.log_diagnosis import TrialSource, set_up_diagnosis
from selfmodel.experiments.robots import is_model, robot_entry
from selfmodel.faults import KINDS, PAPER_KINDS, FaultKind
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs import physical_trial
from selfmodel.logs.journal import create_journal
from selfmodel.logs.records import TrialHeader
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery import recover as loop
from selfmodel.recovery.events import Event
from selfmodel.recovery.next_trial import NextTrial, by_repair
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.recover import Recovery
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.sequential_diagnosis import diagnose_trials
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation import calibration, trial_replay
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.threads import thread_count
from selfmodel.simulation.trial_replay import Replay
from selfmodel.trials.trial import Stage, Trial, TrialPlan


def _kinds(kinds: str | Sequence[FaultKind]) -> Sequence[FaultKind]:
    return plugins.kinds(kinds) if isinstance(kinds, str) else kinds


def _ignore(_event: object) -> None:
    """Default callback, which ignores the event."""


def load_robot(name: str | Path, settings: MjcfSettings | None = None) -> Robot:
    """Returns a robot by name, or the robot of an MJCF file.

    Example:
        >>> import selfmodel
        >>> selfmodel.load_robot("quadruped").anatomy.joint("front_left_knee").hinges
        ('front_left_knee',)

    Args:
        name: ``quadruped``, ``hexapod``, ``suite-DOMAIN-TASK``, or the path of an MJCF file.
        settings: Settings of the MJCF file; None for those of the TOML file beside it.

    Raises:
        InputError: The name is unknown, the file is no valid robot, or settings are given for a
            robot by name.
    """
    if is_model(str(name)):
        return load_mjcf(name, settings)
    if settings is not None:
        raise InputError(f"settings are for an MJCF file: {str(name)!r} is the name of a robot")
    return robot_entry(str(name)).robot()


def parse_hypothesis(
    text: str, robot: Robot, kinds: Sequence[FaultKind] = tuple(KINDS.values())
) -> Hypothesis:
    """Returns the hypothesis of a text in notation.

    Example:
        >>> import selfmodel
        >>> robot = selfmodel.load_robot("quadruped")
        >>> print(selfmodel.parse_hypothesis("friction=0.4+break:front_left_knee", robot))
        break:front_left_knee+friction=0.4

    Args:
        text: Terms ``kind:part``, ``kind:part=severity`` or ``kind=severity`` joined by ``+``, or
            ``intact``.
        robot: The robot whose parts the text names.
        kinds: The fault kinds that the text may name.

    Raises:
        InputError: A term is malformed, or names an unknown kind or part.
    """
    return parse(text, robot.anatomy, kinds)


def evolve_controller(
    robot: Robot,
    hypothesis: Hypothesis = INTACT,
    *,
    design: str | Design = "network",
    seeds: Sequence[Controller] = (),
    settings: Settings | None = None,
    seed: int = 0,
    threads: int = 0,
    on_event: Callable[[Event], None] = _ignore,
) -> Controller:
    """Returns the controller with the largest forward displacement that the repair EA finds.

    Example:
        >>> import selfmodel
        >>> settings = selfmodel.Settings(steps=20, generations=2).scaled(4)
        >>> robot = selfmodel.load_robot("quadruped")
        >>> selfmodel.evolve_controller(robot, settings=settings).design.weights
        68

    Args:
        robot: The nominal robot.
        hypothesis: The faults of the robot in simulation.
        design: Name of a controller design, such as ``network`` or ``cpg``, or a design.
        seeds: Controllers of the first generation, in addition to random controllers.
        settings: Parameters of the search; the paper's by default.
        seed: Seed of all random numbers.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the search.

    Raises:
        InputError: The design is unknown, or a motor has no command range.
    """
    chosen = plugins.design(design, robot) if isinstance(design, str) else design
    search = RepairSearch(Simulator(robot, thread_count(threads)), settings or Settings(), chosen)
    return search(hypothesis, seeds, repair_stream(seed, 0), on_event)


def run_trial(
    physical: PhysicalRobot,
    controller: CommandSource,
    path: str | Path,
    *,
    robot: Robot,
    steps: int = 1000,
    stage: Stage = "single",
    seed: int = 0,
) -> Trial:
    """Runs a physical trial, logs it while it runs, and returns the trial read from the log.

    Args:
        physical: The physical robot.
        controller: Controller or playback that drives the robot.
        path: Name of the log, ``NAME.mcap``; the trial is called NAME.
        robot: The nominal robot.
        steps: Control steps of the trial.
        stage: Stage of the trial within a recovery.
        seed: Seed of the trial, for the record.

    Raises:
        InputError: The log exists, NAME is no name of a trial, or the controller does not fit the
            robot.
        LogError: The robot stopped early, or the log failed its verification.
        TrialError: The physical robot could not finish the trial.
    """
    path = Path(path)
    plan = TrialPlan(path.stem, stage, controller, steps, seed)
    return physical_trial.run_trial(physical, plan, path, robot, TrialHeader(Settings()))


def calibrate(trials: Sequence[Trial], robot: Robot, *, threads: int = 0) -> Calibration:
    """Returns the self-model of a robot, fitted to trials of the healthy robot.

    Args:
        trials: Trials of the healthy robot, at least one.
        robot: The nominal robot.
        threads: Threads of the physics; 0 for all processors.

    Raises:
        InputError: There are no trials, or a trial lacks the signals that a fit needs.
    """
    return calibration.calibrate(robot, trials, thread_count(threads))


def replay(
    trial: Trial,
    hypothesis: Hypothesis,
    robot: Robot,
    *,
    tolerance: float = 0.0,
    threads: int = 0,
) -> Replay:
    """Returns the comparison of a trial with its simulation under a hypothesis.

    Args:
        trial: A logged trial.
        hypothesis: The faults of the robot in simulation.
        robot: The nominal robot.
        tolerance: Largest difference of two numbers that count as equal, in their unit.
        threads: Threads of the physics; 0 for all processors.
    """
    return trial_replay.replay(
        trial, hypothesis, Simulator(robot, thread_count(threads)), tolerance
    )


def diagnose(
    trials: Sequence[TrialSource],
    *,
    healthy: Sequence[TrialSource] = (),
    robot: Robot | None = None,
    comparator: str | Comparator = DEFAULT,
    kinds: str | Sequence[FaultKind] = PAPER_KINDS,
    settings: Settings | None = None,
    calibrate: bool = True,
    seed: int | None = None,
    threads: int = 0,
    on_event: Callable[[Event], None] = _ignore,
) -> Diagnosis:
    """Returns the hypotheses that explain logged trials, ranked, with a verdict.

    Args:
        trials: Trials to explain, or paths of their logs, in the order in which they were run.
            Without ``healthy``, those of the stage ``before`` are healthy if there are trials of
            other stages.
        healthy: Trials of the healthy robot, or paths of their logs: the self-model is fitted to
            them, and the verdict compares with them.
        robot: The nominal robot; None for the model in the logs.
        comparator: A comparator, its name, or ``package.module:object``.
        kinds: Fault kinds to search, or their names separated by commas.
        settings: Parameters of the search; None for those in the first log.
        calibrate: Whether the self-model is fitted to the healthy trials.
        seed: Seed of all random numbers; None for that of the first trial.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the diagnosis.

    Raises:
        InputError: There are no trials, a log is unusable, the comparator cannot judge a trial, or
            no kind applies to the robot.
    """
    judge = plugins.comparator(comparator) if isinstance(comparator, str) else comparator
    found = set_up_diagnosis(
        trials,
        healthy,
        robot=robot,
        comparator=judge,
        kinds=_kinds(kinds),
        settings=settings,
        seed=seed,
        calibrate=calibrate,
        threads=threads,
    )
    if found.calibration is not None:
        on_event(found.calibration)
    return diagnose_trials(found.damaged, found.search, found.seed, on_event)


def recover(
    healthy: PhysicalRobot,
    damaged: PhysicalRobot,
    robot: Robot,
    folder: str | Path,
    *,
    comparator: str | Comparator = DEFAULT,
    kinds: str | Sequence[FaultKind] = PAPER_KINDS,
    settings: Settings | None = None,
    design: str | Design = "network",
    calibrate: bool = True,
    next_trial: NextTrial = by_repair,
    seed: int = 0,
    threads: int = 0,
    on_event: Callable[[Event], None] = _ignore,
) -> Recovery:
    """Runs a recovery: the robot walks, fails, is diagnosed from its logs, and walks again.

    Source: the paper, section III.

    Args:
        healthy: The physical robot before its failure.
        damaged: The physical robot after its failure; on hardware, the same object.
        robot: The nominal robot, from which the self-model is made.
        folder: Folder of the run, new or empty: every trial's log and every diagnosis.
        comparator: A comparator, its name, or ``package.module:object``.
        kinds: Fault kinds to search, or their names separated by commas.
        settings: Parameters of the recovery; the paper's by default.
        design: Name of a controller design, such as ``network`` or ``cpg``, or a design.
        calibrate: Whether the self-model is fitted to the trial before the failure.
        next_trial: Chooses the controller of each trial after the failing one.
        seed: Seed of all random numbers.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the recovery.

    Raises:
        InputError: The folder contains files, or an argument is invalid.
        TrialError: A physical robot could not finish a trial.
    """
    count = thread_count(threads)
    chosen, searched = settings or Settings(), _kinds(kinds)
    journal = create_journal(Path(folder), robot.anatomy, searched)
    return loop.recover(
        healthy=healthy,
        damaged=damaged,
        simulator=Simulator(robot, count),
        comparator=plugins.comparator(comparator) if isinstance(comparator, str) else comparator,
        run_trial=physical_trial.TrialRunner(journal.trials, robot, chosen),
        journal=journal,
        settings=chosen,
        seed=seed,
        on_event=on_event,
        design=plugins.design(design, robot) if isinstance(design, str) else design,
        kinds=searched,
        calibrate=partial(fitted, robot, threads=count) if calibrate else None,
        next_trial=next_trial,
    )
