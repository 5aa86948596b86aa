"""``selfmodel recover``: options, run, result, print and report.

What a recovery does, in order, is ``selfmodel.recovery.recover.RecoveryLoop.run``; the simulated
robots that it drives here are drawn by ``selfmodel.studies.experiment.run``.
"""

import os
from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli import inputs
from selfmodel.cli.commands import Recover, repair_settings_of, settings_of
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import display
from selfmodel.cli.tables import folding, print_tables, ranking_table
from selfmodel.controllers.controller import check_silent_neurons
from selfmodel.diagnosis.text import right_or_wrong, summary, verdict_sentences
from selfmodel.errors import InputError, counted
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.sensors import silent_neurons
from selfmodel.files import read_file
from selfmodel.logs import results
from selfmodel.logs.controllers import (
    MAX_CONTROLLER_BYTES,
    controller_bytes,
    npz_bytes,
    npz_errors,
    parse_controller,
    read_arrays,
)
from selfmodel.logs.files import make_folder, replace_file
from selfmodel.recovery.candidates import CandidateController
from selfmodel.recovery.recover import FirstGait, evolved
from selfmodel.recovery.result import Recovery
from selfmodel.recovery.scores import DISPLACEMENT, value_text
from selfmodel.report.charts import REPORT, html_of
from selfmodel.report.content import report_of
from selfmodel.report.progress import RunProgress
from selfmodel.report.subject import subject_of_run
from selfmodel.settings import RepairSettings, Settings
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies.experiment import Experiment, choose_score, result_of, run
from selfmodel.tasks import Entry

WORTH_KEEPING = 10**6
"""Fewest control steps of the paper's evaluations of a first gait that is kept: half a minute."""


def recover(options: Recover) -> None:
    """Recover a robot from a failure: diagnose it from logged trials, evolve a controller."""
    experiment = experiment_of(options)
    with display(experiment.robot) as on_event:
        progress = RunProgress(
            experiment.folder,
            experiment.robot,
            on_event,
            experiment.threads,
            reports=options.report,
        )
        with progress.kept_on_failure():
            outcome = run(experiment, progress)
    result, folder = result_of(experiment, outcome), experiment.folder
    try:
        results.write_searches(folder, progress.searches)
        result.write(folder, experiment.settings, experiment.repair_settings)
    finally:  # the result is printed even if the disk is full
        if options.as_json:
            print_json(results.as_json(result))
        else:
            _print(result, outcome.recovery, folder)
    if options.report:
        subject = subject_of_run(folder, experiment.threads, options.comparator, experiment.kinds)
        replace_file(folder / REPORT, html_of(report_of(subject)))
        print_notes(f"report: {folder / REPORT}")


def experiment_of(options: Recover) -> Experiment:
    """Returns the experiment of the options; refuses what is wrong before any work."""
    entry = arguments.robot_entry(options.robot, options.model_settings or ())
    kinds = plugins.kinds(options.kinds)
    damage = inputs.case_notation(options.robot, entry.cases, options.case, options.damage)
    robot = entry.robot()
    gait, neurons = None, options.neurons
    if inputs.is_file(options.controller):
        gait = arguments.read_controller(Path(options.controller), robot, neurons)
    design = gait.design if gait else plugins.design(options.controller, robot, neurons)
    repair, design, gait = plugins.repaired_around(options.repair, design, gait)
    space = HypothesisSpace(robot.anatomy, kinds)
    truth, known = space.parse(damage), space.parse(options.hypothesis)
    check_silent_neurons(design, silent_neurons(truth))
    gaits = arguments.repertoire_of(options.repertoire, robot, design)
    plugins.repair(repair, options.search, gaits)
    plugins.next_trial(options.next_trial)
    fitness = options.score or plugins.DEFAULT_SCORES[repair]
    settings = settings_of(options, fitness)
    score = choose_score(
        fitness,
        entry,
        design,
        steps=settings.steps,
        seed=options.seed,
        reference=options.reference,
        gait=gait,
        max_speed=options.max_joint_speed,
        max_torque=options.max_joint_torque,
        max_self_collision=options.max_self_collision,
    )
    if score.gait is not None and gait is None:
        print_notes(
            f"note: no --reference is given, so the robot is to repeat the motion of its first "
            f"controller, a {design.name} with random weights: the {score.score.name} before the "
            f"failure is 0, except for a reality gap"
        )
    now = datetime.now().astimezone()
    own = repair_settings_of(options, settings)
    is_given = score.gait is not None or not options.cache
    first_gait = evolved if is_given else _first_gait(options, entry, settings, own)
    return Experiment(
        robot=robot,
        case=options.case,
        truth=truth,
        choose_comparator=arguments.comparator_choice(options.comparator),
        kinds=kinds,
        hypothesis=known,
        calibrated=options.calibrate,
        settings=settings,
        seed=options.seed,
        threads=thread_count(options.threads),
        # The name of a new folder does not contain the hidden failure.
        folder=options.out or Path("runs") / f"{robot.name}-{now:%Y%m%d-%H%M%S-%f}",
        gap=options.gap,
        next_trial=options.next_trial,
        design=design,
        gait=score.gait,
        first_gait=first_gait,
        score=score.score,
        entry=entry,
        repair=repair,
        search=options.search,
        repertoire=gaits,
        repair_settings=own,
    )


def _first_gait(
    options: Recover, entry: Entry, settings: Settings, own: RepairSettings | None
) -> FirstGait:
    """Returns a function that returns the first gait of an earlier run, or evolves and keeps it.

    What determines the gait names its file: the model, the options, and the code. One of a small
    search is not kept, nor one that files or plug-ins determine.
    """
    of_repair = settings.of_repair(own)
    limits = (options.max_joint_speed, options.max_joint_torque, options.max_self_collision)
    has_files = any(one is not None for one in (options.repertoire, options.reference, *limits))
    if has_files or of_repair.evaluations * of_repair.steps < WORTH_KEEPING:
        return evolved
    from selfmodel.studies import recoveries  # noqa: PLC0415  # many recoveries have a gait

    repair = recoveries.repair_parameters(options.repair, options.search, options.score, own)
    of_gait = {"controller": options.controller, "neurons": options.neurons, **repair}
    shared = {"settings": asdict(settings), **of_gait}
    cell = recoveries.gait_cell(recoveries.planned(options.robot, entry), shared, options.seed)
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        home = given if given.is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # a user without a home, as in a container
        return evolved
    if cell.modules:
        return evolved
    path = home / "selfmodel" / f"{cell.place}.npz"
    if not os.access(path, os.R_OK):
        return partial(_keep, path)
    try:
        kept = _kept(path)
    except InputError as error:
        print_notes(f"note: the first gait is evolved again: {error}")
        return partial(_keep, path)
    print_notes(f"note: the first gait is of an earlier run, {path}; --no-cache evolves it again")
    return lambda _: kept


def _kept(path: Path) -> CandidateController:
    with npz_errors(str(path), "the gait of an earlier run"):
        arrays = read_arrays(read_file(path, "a gait", MAX_CONTROLLER_BYTES), MAX_CONTROLLER_BYTES)
        controller = parse_controller(arrays["controller"].tobytes(), str(path))
        return CandidateController(controller, arrays["scores"])


def _keep(path: Path, evolve: Callable[[], CandidateController]) -> CandidateController:
    """Evolves a gait, and keeps it.

    That of a self-model that flatters is not kept: what follows is evolved at a finer time step.
    """
    found = evolve()
    if found.parts == 1:
        data = np.frombuffer(controller_bytes(found.controller), dtype=np.uint8)
        try:
            make_folder(path.parent)
            replace_file(path, npz_bytes({"controller": data, "scores": found.scores}))
        except (InputError, OSError):
            print_notes(f"note: the first gait is not kept: {path.parent} is not writable, or full")
    return found


def _print(found: results.RecoveryResult, recovery: Recovery, folder: Path) -> None:
    diagnosis, score, evaluations = recovery.diagnosis, found.score, found.evaluations
    is_way = score.name == DISPLACEMENT.name
    subject = "The robot went" if is_way else f"The score {score.name} was"
    ways = (score.before, score.after, score.recovered)
    before, after, recovered = (value_text(value, score.unit, score.most) for value in ways)
    columns, *rows = recovery.table
    trials = folding(columns, rows, title="physical trials", texts=2)
    print_tables(trials, ranking_table(results.as_json(found), found.truth))
    gap = f", at a reality gap of {found.gap:g}" if found.gap else ""
    verdict = right_or_wrong(str(diagnosis.best), found.truth, correct=found.correct)
    print_lines(
        f"truth: {found.truth}{gap}; the diagnosis is {verdict}.",
        *summary(diagnosis),
        verdict_sentences(diagnosis),
        f"{subject} {before} before, {after} after the failure, and {recovered} at best in "
        f"{counted(found.physical_trials, 'trial')} since.",
        *(["The robot fell in that trial, which is no recovery."] if found.fell else []),
        *(f"Warning: {text}." for text in found.warnings),
        f"{evaluations['repair']} controllers and {evaluations['distinct_hypotheses']} distinct "
        f"hypotheses in {found.seconds:.0f} s; diverged: {evaluations['diverged']}.",
        f"Logs: {folder}",
    )
