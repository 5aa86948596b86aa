"""The public functions that search: one call from names and files to a result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from selfmodel import arguments, plugins
from selfmodel.arguments import AUTO, KindSource, RobotSource, TrialSource
from selfmodel.controllers.controller import Controller, Design
from selfmodel.diagnosis.choice import ChosenComparator, ComparatorChoice
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch, check_known
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError, check_type, items_of, real_number, whole_number
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import DEFAULT_KINDS, notation_kinds
from selfmodel.files import path_of
from selfmodel.logs import export
from selfmodel.logs.files import create_file, make_folder
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.progress import Progress, ignore, timed
from selfmodel.recovery import recover as recovery_loop
from selfmodel.recovery.repair import MakeSearch
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.result import Event, Recovery
from selfmodel.recovery.scores import Score
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import RepairSettings, Settings
from selfmodel.simulation import calibration, trial_replay
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.simulator import Simulator, thread_count
from selfmodel.studies.experiment import Experiment, choose_score, run_recovery
from selfmodel.trials.trial import Trial, by_stage


def evolve(
    robot: RobotSource,
    hypothesis: Hypothesis | str = INTACT,
    *,
    design: str | Design = "network",
    seeds: Controller | str | Path | Sequence[Controller | str | Path] = (),
    settings: Settings | None = None,
    score: Score | str | None = None,
    repair: str = plugins.ROBUST,
    search: str | None = None,
    repertoire: Repertoire | str | Path | None = None,
    seed: int = 0,
    threads: int = 0,
    on_event: Callable[[Event], None] = ignore,
) -> Controller:
    """Returns the best controller that a repair finds: by default the first gait of ``recover``.

    Example:
        >>> import selfmodel
        >>> settings = selfmodel.Settings(steps=20, generations=2).scaled(4)
        >>> selfmodel.evolve("quadruped", settings=settings)
        <Controller: a network of 3 hidden neurons>

    Args:
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        hypothesis: The faults of the robot in simulation, or their notation.
        design: Name of a controller design, such as ``network`` or ``cpg``, or a design.
        seeds: Controllers of the first generation, or their files, in addition to random ones.
        settings: Parameters of the search; the paper's by default.
        score: Fitness, its name, or ``package.module:object``; by default that of the repair.
        repair: ``robust``, on rollouts under random conditions; or ``paper``, in one exact
            simulation.
        search: ``cma-es``, ``ea``, ``es`` or ``repertoire``; by default that of the repair.
        repertoire: Gaits from which the search begins, or the path of their file.
        seed: Seed of all random numbers.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the search.

    Raises:
        InputError: The design or the robot is unknown, the notation is invalid, a motor has no
            command range, or the robot cannot have the score.
    """
    seed, settings = whole_number("seed", seed, 0, least=0), arguments.settings_of(settings)
    arguments.check_options(on_event)
    robot = (entry := arguments.entry_of(robot)).robot()
    chosen = arguments.design_of(design, robot)
    repair, chosen, _ = plugins.repaired_around(repair, chosen, None)
    score = score or plugins.DEFAULT_SCORES[repair]
    fitness, _ = choose_score(score, entry, chosen, steps=settings.steps, seed=seed)
    gaits = arguments.repertoire_of(repertoire, robot, chosen)
    make_repair = plugins.repair(repair, search, gaits)
    repaired = make_repair(Simulator(robot, threads), settings, chosen, fitness)(
        (arguments.parse_hypothesis(hypothesis, robot),),
        partial(assumed_uncertainty, robot),
        [arguments.controller_of(one, robot) for one in items_of(seeds)],
        recovery_loop.random_stream(seed, "repair"),
        on_event,
    )
    return repaired[0].controller


def calibrate(
    trials: TrialSource | Sequence[TrialSource],
    robot: RobotSource,
    *,
    threads: int = 0,
    on_event: Callable[[Progress], None] = ignore,
) -> Calibration:
    """Returns the self-model of a robot, fitted to trials of the healthy robot.

    Example:
        >>> import selfmodel
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> physical = selfmodel.simulated_robot("quadruped")
        >>> trial = selfmodel.run_trial(
        ...     physical, walk, "healthy.mcap", robot="quadruped", steps=60
        ... )
        >>> fit = selfmodel.calibrate(trial, "quadruped")
        >>> fit.parameters.friction
        1.0

    Args:
        trials: Trials of the healthy robot, or paths of their logs, at least one.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the fit.

    Raises:
        InputError: There are no trials, a log is unusable, or a trial lacks the signals that a fit
            needs.
    """
    arguments.check_options(on_event)
    (healthy,), _ = arguments.trials_of(trials)
    arguments.check_trials(robot := arguments.load_robot(robot), *healthy)
    return calibration.calibrate(robot, healthy, thread_count(threads), timed(on_event))


def replay(
    trial: TrialSource,
    hypothesis: Hypothesis | str,
    robot: RobotSource,
    *,
    tolerance: float = 0.0,
    threads: int = 0,
) -> trial_replay.Replay:
    """Returns the comparison of a trial with its simulation under a hypothesis.

    Example:
        >>> import selfmodel
        >>> selfmodel.replay("after.mcap", "break:front_left_knee", "quadruped").identical
        False

    Args:
        trial: A logged trial, or the path of its log.
        hypothesis: The faults of the robot in simulation, or their notation.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        tolerance: Largest difference of two numbers that count as equal, in their unit.
        threads: Threads of the physics; 0 for all processors.

    Raises:
        InputError: The log is unusable, the robot is unknown, or the notation is invalid.
    """
    logged = arguments.trial_of(trial)
    tolerance = real_number("tolerance", tolerance, 0.0, 0.0, "real")
    arguments.check_trials(robot := arguments.load_robot(robot), logged)
    assumed = arguments.parse_hypothesis(hypothesis, robot)
    return trial_replay.replay(logged, assumed, Simulator(robot, threads), tolerance)


def diagnose(
    trials: TrialSource | Sequence[TrialSource],
    *,
    healthy: TrialSource | Sequence[TrialSource] | None = (),
    robot: RobotSource | None = None,
    comparator: str | Comparator = AUTO,
    kinds: KindSource = DEFAULT_KINDS,
    hypothesis: Hypothesis | str = INTACT,
    settings: Settings | None = None,
    calibrate: bool = True,
    seed: int | None = None,
    threads: int = 0,
    on_event: Callable[[Event], None] = ignore,
) -> Diagnosis:
    """Returns the hypotheses that explain logged trials, ranked, with a verdict.

    Example:
        >>> import selfmodel
        >>> settings = selfmodel.Settings(generations=2).scaled(6)
        >>> diagnosis = selfmodel.diagnose(
        ...     "after.mcap", healthy="before.mcap", kinds="paper",
        ...     settings=settings, calibrate=False,
        ... )
        >>> print(diagnosis.best, diagnosis.verdict)
        break:front_left_knee explained

    Args:
        trials: Trials to explain, or paths of their logs, in the order in which they were run.
            Without ``healthy``, those of the stage ``before`` are healthy if there are trials of
            other stages.
        healthy: Trials of the healthy robot, or paths of their logs: the self-model is fitted to
            them, and the verdict compares with them.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file; None for the
            model in the logs.
        comparator: A comparator, its name, or ``package.module:object``; ``auto`` for the best
            that the trials allow.
        kinds: Fault kinds to search, or names of kinds and of their sets, in a sequence or
            separated by commas.
        hypothesis: Hypothesis, or its notation, that the search begins from, such as what you know
            of the robot; it is kept only if the trials require it.
        settings: Parameters of the search; None for those in the first log.
        calibrate: Whether the self-model is fitted to the healthy trials.
        seed: Seed of all random numbers; None for that of the first trial.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the diagnosis.

    Raises:
        InputError: There are no trials, a log is unusable, the comparator cannot judge a trial, or
            no kind applies to the robot.
    """
    seed = None if seed is None else whole_number("seed", seed, 0, least=0)
    arguments.check_options(on_event, calibrate=calibrate)
    on_event, own = timed(on_event), None if robot is None else arguments.load_robot(robot)
    choose, searched = arguments.comparator_choice(comparator), arguments.kinds_of(kinds)
    (to_explain, reference), logs = arguments.trials_of(trials, () if healthy is None else healthy)
    if not to_explain:
        raise InputError("expected at least one trial to explain, got none")
    if own is None and len(logs) < len(to_explain) + len(reference):
        raise InputError(
            "a trial without a log has no model of its robot: give robot=, such as "
            'selfmodel.load_robot("quadruped")'
        )
    if not reference:
        to_explain, reference = by_stage(to_explain)
    own = own or arguments.robot_of_logs(logs, None)
    arguments.check_trials(own, *to_explain, *reference)
    logged = {log.trial.path: log.settings for log in logs}
    return diagnosis_of_logs(
        to_explain,
        reference,
        robot=own,
        choose_comparator=choose,
        kinds=searched,
        hypothesis=arguments.parse_hypothesis(hypothesis, own, notation_kinds(searched)),
        settings=arguments.settings_of(settings or logged.get(to_explain[0].path)),
        seed=seed,
        calibrate=calibrate,
        threads=threads,
        on_event=on_event,
    ).diagnosis


def recover(
    healthy: PhysicalRobot,
    damaged: PhysicalRobot,
    robot: RobotSource,
    folder: str | Path,
    *,
    comparator: str | Comparator = AUTO,
    kinds: KindSource = DEFAULT_KINDS,
    settings: Settings | None = None,
    hypothesis: Hypothesis | str = INTACT,
    design: str | Design = "network",
    gait: Controller | str | Path | None = None,
    calibrate: bool = True,
    next_trial: recovery_loop.NextTrial | str = recovery_loop.by_repair,
    score: Score | str | None = None,
    repair: str | None = None,
    search: str | MakeSearch | None = None,
    repertoire: Repertoire | str | Path | None = None,
    repair_settings: RepairSettings | None = None,
    seed: int = 0,
    threads: int = 0,
    on_event: Callable[[Event], None] = ignore,
) -> Recovery:
    """Runs a recovery: the robot walks, fails, is diagnosed from its logs, and walks again.

    Source: the paper, section III.

    Example:
        >>> import selfmodel
        >>> healthy = selfmodel.simulated_robot("quadruped")
        >>> damaged = selfmodel.simulated_robot("quadruped", "break:front_left_knee")
        >>> settings = selfmodel.Settings(steps=60, trials=1, generations=1).scaled(4)
        >>> recovery = selfmodel.recover(
        ...     healthy, damaged, "quadruped", "run", settings=settings, kinds="paper"
        ... )
        >>> print(recovery.diagnosis.best, recovery.diagnosis.verdict)
        break:front_left_knee explained

    Args:
        healthy: The physical robot before its failure.
        damaged: The physical robot after its failure; on hardware, the same object.
        robot: The nominal robot, its name, or its MJCF or URDF file, which is the self-model.
        folder: Folder of the run, new or empty: every trial's log and every diagnosis.
        comparator: A comparator, its name, or ``package.module:object``; ``auto`` for the best one.
        kinds: Fault kinds to search, or names of kinds and of their sets, in a sequence or
            separated by commas.
        hypothesis: Hypothesis, or its notation, that the first diagnosis begins from, such as what
            you know of the robot; it is kept only if the trials require it.
        settings: Parameters of the recovery; the paper's by default.
        design: Name of a controller design, such as ``network`` or ``cpg``, or a design.
        gait: Controller with which the robot walks, such as its policy, or the path of its file;
            ``design`` is then its own. Evolved if not given.
        calibrate: Whether the self-model is fitted to the trial before the failure.
        next_trial: Choice of the controllers of later trials, a function or its name.
        score: Fitness of the repair, its name, or ``package.module:object``; by default the forward
            displacement until the first fall, or the whole displacement for the paper's repair.
        repair: ``robust``, on rollouts under random conditions; ``paper``, in one exact
            simulation; ``compensate``, of a layer around ``gait``, the default with one; or
            ``finetune``, of the last layer of the network of ``gait``. The last two end with the
            first trial in which the robot walks as before.
        search: ``cma-es``, ``ea``, ``repertoire`` or a function that makes one; by default that of
            the repair, CMA-ES or the paper's EA, or the repertoire if one is given.
        repertoire: Gaits from which the search begins, or the path of their file.
        repair_settings: Parameters of the repair and of the first gait, whose runs have as many
            steps as those of ``settings``; by default ``settings``, which are then of both.
        seed: Seed of all random numbers.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called with the progress of the recovery.

    Raises:
        InputError: The folder contains files, an argument is invalid, or the score needs what is
            not observed of the robot.
        TrialError: A physical robot could not finish a trial.
    """
    arguments.check_options(on_event, calibrate=calibrate)
    check_type(repair_settings, RepairSettings | None, arguments.REPAIR_SETTINGS)
    folder, on_event = path_of(folder, "a new or empty folder"), timed(on_event)
    robot = (entry := arguments.entry_of(robot)).robot()
    arguments.check_physical(robot, healthy, damaged)
    seed, count = whole_number("seed", seed, 0, least=0), thread_count(threads)
    chosen, searched = arguments.settings_of(settings), arguments.kinds_of(kinds)
    drawn = arguments.design_of(design, robot)
    gait = None if gait is None else arguments.controller_of(gait, robot)
    if gait is not None:
        arguments.check_robot(gait.design, robot, "the gait")
    repair, drawn, gait = plugins.repaired_around(repair, gait.design if gait else drawn, gait)
    score = score or plugins.DEFAULT_SCORES[repair]
    score, gait = choose_score(score, entry, drawn, steps=chosen.steps, seed=seed, gait=gait)
    experiment = Experiment(
        robot=robot,
        choose_comparator=arguments.comparator_choice(comparator),
        settings=chosen,
        seed=seed,
        threads=count,
        folder=folder,
        gait=gait,
        kinds=searched,
        hypothesis=arguments.parse_hypothesis(hypothesis, robot, notation_kinds(searched)),
        calibrated=calibrate,
        next_trial=next_trial,
        design=drawn,
        score=score,
        repair=repair,
        search=search,
        repertoire=arguments.repertoire_of(repertoire, robot, drawn),
        repair_settings=repair_settings,
    )
    return run_recovery(experiment, healthy, damaged, on_event)


def export_diagnosis(diagnosis: Diagnosis, robot: RobotSource, folder: str | Path) -> Path:
    """Writes a diagnosis for other software into a folder, and returns the folder.

    Example:
        >>> import selfmodel
        >>> small = selfmodel.Settings(generations=2).scaled(6)
        >>> diagnosis = selfmodel.diagnose("after.mcap", kinds="paper", settings=small)
        >>> folder = selfmodel.export_diagnosis(diagnosis, "quadruped", "damaged")
        >>> sorted(path.name for path in folder.iterdir())
        ['model.xml', 'status.json']

    Args:
        diagnosis: The diagnosis.
        robot: The self-model, its name, or the path of its MJCF or URDF file.
        folder: Folder, made if it is missing, for ``model.xml`` and ``status.json``.

    Raises:
        InputError: The folder has such a file.
    """
    check_type(diagnosis, Diagnosis, "a Diagnosis")
    files = export.files_of(diagnosis, arguments.load_robot(robot))
    folder = path_of(folder, "a folder")
    make_folder(folder)
    for name, data in files.items():
        with create_file(folder / name) as file:
            file.write(data)
    return folder


@dataclass(frozen=True, eq=False)
class LogDiagnosis:
    """Diagnosis of logged trials, with those to explain, and those of the healthy robot.

    ``comparator`` has the reason for its choice; ``calibration`` is None without a fit.
    """

    damaged: tuple[Trial, ...]
    healthy: tuple[Trial, ...]
    comparator: ChosenComparator
    calibration: Calibration | None
    search: DiagnosticSearch
    seed: int
    diagnosis: Diagnosis


def diagnosis_of_logs(
    damaged: Sequence[Trial],
    healthy: Sequence[Trial],
    *,
    robot: Robot,
    choose_comparator: ComparatorChoice,
    kinds: Sequence[FaultKind],
    hypothesis: Hypothesis,
    settings: Settings,
    seed: int | None,
    calibrate: bool,
    threads: int,
    on_event: Callable[[Event], None],
) -> LogDiagnosis:
    """Returns the diagnosis of trials: chooses the comparator, calibrates, then searches.

    The arguments are those of ``diagnose``; without healthy trials, there is no calibration.

    Raises:
        InputError: As for ``diagnose``.
    """
    said = [{trial.plan.stage for trial in trials} for trials in (damaged, healthy)]
    if said[0] == {"before"} and said[1] and said[1] <= {"after", "recovery"}:
        raise InputError(
            f"{damaged[0].path} is to be explained and was recorded before the failure, and "
            f"{healthy[0].path}, given as healthy, after it: swap them"
        )
    check_known(hypothesis, settings)
    chosen, count = choose_comparator(robot, [*healthy, *damaged]), thread_count(threads)
    on_event(chosen)
    is_fitted = calibrate and len(healthy) > 0
    fit = arguments.fitted(robot, healthy, count, on_event) if is_fitted else None
    if fit is not None:
        on_event(fit)
    search = DiagnosticSearch(
        Simulator(fit.robot if fit else robot, count),
        chosen.comparator,
        settings,
        kinds,
        healthy_trials=healthy,
        refit=calibration.Refit(robot, fit, count, on_event) if fit else None,
    )
    drawn = damaged[0].plan.seed if seed is None else seed
    found = recovery_loop.diagnose_trials(damaged, search, drawn, on_event, hypothesis=hypothesis)
    return LogDiagnosis(tuple(damaged), tuple(healthy), chosen, fit, search, drawn, found)
