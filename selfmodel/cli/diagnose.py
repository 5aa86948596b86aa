"""``selfmodel diagnose``: hypotheses ranked by how well they predict logged trials."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from selfmodel import arguments, plugins
from selfmodel.api import LogDiagnosis, diagnosis_of_logs, export_diagnosis
from selfmodel.cli.commands import Diagnose, FromLogs
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import display
from selfmodel.cli.tables import print_tables, ranking_table
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis import text
from selfmodel.diagnosis.diagnosis import output_of, to_json
from selfmodel.diagnosis.direct_evidence import direct_evidence
from selfmodel.errors import counted
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.files import file_digest
from selfmodel.logs import TrialLog
from selfmodel.logs.export import MODEL, STATUS
from selfmodel.logs.files import refuse_existing, refuse_file
from selfmodel.logs.results import LogsResult, as_json as values_of
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.robot.robot import Robot
from selfmodel.settings import ADDED
from selfmodel.trials.trial import by_stage, trial_names


def diagnose(options: Diagnose) -> None:
    """Rank hypotheses by how well they predict logged trials, without a robot."""
    start = perf_counter()
    if options.export is not None:
        refuse_file(options.export)
        for name in (MODEL, STATUS):
            refuse_existing(options.export / name)
    explained, robot, inputs = diagnose_logs(options.files, options)
    diagnosis = inputs.diagnosis
    evidence = direct_evidence(
        diagnosis.explained(inputs.damaged), robot.anatomy, trial_names(inputs.damaged)
    )
    paths = [log.trial.path for log in explained]
    result = LogsResult(
        robot=robot.name,
        model=self_model_digest(robot),
        comparator=inputs.comparator.comparator.name,
        comparator_reason=inputs.comparator.reason,
        kinds=tuple(kind.name for kind in plugins.kinds(options.kinds)),
        seed=inputs.seed,
        settings_from=paths[0],
        logs=tuple(paths),
        played_back=tuple(log.trial.path for log in explained if _is_played_back(log)),
        intact=tuple(trial.path for trial in inputs.healthy),
        files={str(path): file_digest(path) for path in [*(options.healthy or ()), *options.files]},
        calibration=inputs.calibration.to_dict() if inputs.calibration else None,
        **output_of(diagnosis),
        summary=" ".join(text.summary(diagnosis)),
        evidence=to_json(evidence),
        evaluations=inputs.search.evaluations,
        distinct_hypotheses=inputs.search.distinct_hypotheses,
        seconds=perf_counter() - start,
    )
    if options.export is not None:
        fit = inputs.calibration
        export_diagnosis(diagnosis, fit.robot if fit else robot, options.export)
    if options.as_json:
        print_json(values_of(result))
        return
    print_lines(*text.summary(diagnosis))
    print_tables(ranking_table(values_of(result)))
    print_lines(
        f"{result.robot}, {counted(len(paths), 'log')}, {result.comparator}: "
        f"{result.evaluations} evaluations by the EA, {result.distinct_hypotheses} distinct "
        f"hypotheses, {diagnosis.cost.control_steps} simulated steps, {result.seconds:.1f} s.",
        f"Comparator {result.comparator}: {result.comparator_reason}.",
        text.verdict_sentences(diagnosis),
        text.fit_sentence(diagnosis),
        *text.detectable_sentences(diagnosis),
        *text.evidence_sentences(evidence),
        *(f"from before the failure, not explained: {Path(one.path)}" for one in inputs.healthy),
        *([f"For other software: {options.export}"] if options.export else []),
    )


def diagnose_logs(
    files: Sequence[Path], options: FromLogs
) -> tuple[list[TrialLog], Robot, LogDiagnosis]:
    """Returns the logs to explain, in order, the nominal robot, and the diagnosis with its inputs.

    Prints notes and progress on standard error.
    """
    kinds = plugins.kinds(options.kinds)
    comparator = arguments.comparator_choice(options.comparator)
    logs = arguments.read_logs([*(options.healthy or ()), *files])
    robot = arguments.robot_of_logs(logs, options.self_model)
    trials = tuple(log.trial for log in logs)
    split = len(options.healthy or ())
    failed, before = by_stage(trials[split:])
    healthy = trials[:split] + before
    explained = [log for log in logs if log.trial in failed]
    settings = explained[0].settings
    given = {one: getattr(options, one) for one in ("generations", "genes", *ADDED)}
    asked = {name: value for name, value in given.items() if value is not None}
    settings = dataclasses.replace(settings, **asked)
    if options.population is not None:
        settings = settings.scaled(options.population)
    print_notes(*(f"note: {note}" for note in _notes(explained)))
    with display() as on_event:
        inputs = diagnosis_of_logs(
            failed,
            healthy,
            robot=robot,
            choose_comparator=comparator,
            kinds=kinds,
            hypothesis=HypothesisSpace(robot.anatomy, kinds).parse(options.hypothesis),
            settings=settings,
            seed=options.seed,
            calibrate=options.calibrate,
            threads=options.threads,
            on_event=on_event,
        )
    return explained, robot, inputs


def _is_played_back(log: TrialLog) -> bool:
    return isinstance(log.trial.plan.controller, Playback)


def _notes(logs: Sequence[TrialLog]) -> list[str]:
    first = logs[0]
    notes = [
        f"{log.trial.path} has no controller: its commands are played back, so a sensor fault "
        f"does not change the motion"
        for log in logs
        if _is_played_back(log)
    ]
    notes += [
        f"{log.trial.path}: {log.timing.late.sum()} of "
        f"{counted(log.trial.trajectory.steps, 'step')} were late; comparators of short segments "
        f"leave late steps out, comparators of whole trials do not"
        for log in logs
        if log.timing is not None and log.timing.late.any()
    ]
    if any(log.settings != first.settings for log in logs):
        notes.append(f"the logs have different settings: those of {first.trial.path} are used")
    if any(log.trial.plan.seed != first.trial.plan.seed for log in logs):
        notes.append(
            f"the logs have different seeds: without --seed, that of {first.trial.path} is used"
        )
    return notes
