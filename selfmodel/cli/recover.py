"""``selfmodel recover``: the paper's loop, from a healthy gait to one for the damaged robot."""

from datetime import datetime
from functools import partial
from os.path import relpath
from pathlib import Path

from selfmodel import arguments, plugins
from selfmodel.arguments import comparator_choice, repertoire_of
from selfmodel.cli import inputs
from selfmodel.cli.commands import Recover
from selfmodel.cli.output.display import displacement_text, display
from selfmodel.cli.output.printing import print_json, print_notes
from selfmodel.cli.output.report import print_report, recovery_result
from selfmodel.controllers.controller import check_silent_neurons
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.sensors import silent_neurons
from selfmodel.files import file_digest
from selfmodel.logs.files import replace_file
from selfmodel.logs.result_files import result_bytes
from selfmodel.logs.results import RESULT, as_json as values_of, write_searches
from selfmodel.recovery.scores import DISPLACEMENT, Score
from selfmodel.report.charts import REPORT, html_of
from selfmodel.report.content import report_of
from selfmodel.report.progress import Progress
from selfmodel.report.subject import subject_of_run
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies.experiment import Experiment, choose_score, run
from selfmodel.trials.trial import Trial


def recover(options: Recover) -> None:
    """Recover a robot from a failure: diagnose it from logged trials, evolve a controller."""
    entry = arguments.robot_entry(options.robot, options.model_settings or ())
    considered = plugins.kinds(options.kinds)
    damaged = inputs.case_notation(entry.cases, options.case, options.damage)
    made = entry.robot()
    design = plugins.design(options.controller, made, options.neurons)
    truth = HypothesisSpace(made.anatomy, considered).parse(damaged)
    check_silent_neurons(design, silent_neurons(truth))
    gaits = repertoire_of(options.repertoire, made, design)
    plugins.repair(
        options.repair, options.search, gaits
    )  # an unknown name is refused before any work
    settings = Settings(
        steps=options.steps, trials=options.trials, generations=options.generations
    ).scaled(options.population)
    chosen = choose_score(
        options.score or plugins.DEFAULT_SCORES[options.repair],
        entry,
        design,
        steps=options.steps,
        seed=options.seed,
        reference=options.reference,
        max_speed=options.max_joint_speed,
        max_torque=options.max_joint_torque,
        max_self_collision=options.max_self_collision,
    )
    if chosen.gait is not None:
        print_notes(
            f"note: no --reference is given, so the robot is to repeat the motion of its first "
            f"controller, a {design.name} with random weights: the {chosen.score.name} before the "
            f"failure is 0, except for a reality gap"
        )
    experiment = Experiment(
        robot=made,
        case=options.case,
        truth=truth,
        choose_comparator=comparator_choice(options.comparator),
        kinds=considered,
        calibrated=options.calibrate,
        settings=settings,
        seed=options.seed,
        threads=thread_count(options.threads),
        folder=options.out or _new_folder(made.name),
        gap=options.gap,
        next_trial=plugins.next_trial(options.next_trial),
        design=design,
        gait=chosen.gait,
        score=chosen.score,
        physical=entry.physical,
        repair=options.repair,
        search=options.search,
        repertoire=gaits,
    )
    with display(partial(_described, made, chosen.score)) as on_event:
        progress = Progress(
            experiment.folder, made, on_event, experiment.threads, reports=options.report
        )
        with progress.kept_on_failure():
            outcome = run(experiment, progress)
    result = recovery_result(experiment, outcome)
    try:
        write_searches(experiment.folder, progress.searches)
        logs = [Path(trial.path) for trial in outcome.recovery.trials]
        content = result.as_file(
            settings, {relpath(one, experiment.folder): file_digest(one) for one in logs}
        )
        replace_file(experiment.folder / RESULT, result_bytes(content))
    finally:  # the result is printed even if the disk is full
        if options.as_json:
            print_json(values_of(result))
        else:
            print_report(values_of(result), outcome.recovery.diagnosis, experiment.folder)
    if options.report:
        subject = subject_of_run(
            experiment.folder, experiment.threads, options.comparator, considered
        )
        replace_file(experiment.folder / REPORT, html_of(report_of(subject)))
        print_notes(f"report: {experiment.folder / REPORT}")


def _described(robot: Robot, score: Score, trial: Trial) -> str:
    """Returns the score of a trial as text; the physical robot's failure is taken as unknown."""
    if score is DISPLACEMENT:
        return displacement_text(trial)
    value = score.of_trial(robot, INTACT, trial)
    return f"{score.name} {value:.4f} {score.unit}".rstrip()


def _new_folder(robot: str) -> Path:
    """Returns an unused folder in ``runs/``; its name does not contain the hidden failure."""
    return Path("runs") / f"{robot}-{datetime.now().astimezone():%Y%m%d-%H%M%S-%f}"
