"""``selfmodel diagnose``: hypotheses ranked by how well they predict logged trials."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from selfmodel import arguments, plugins
from selfmodel.api import LogDiagnosis, by_stage, set_up_diagnosis
from selfmodel.arguments import comparator_choice
from selfmodel.cli.commands import Diagnose
from selfmodel.cli.output.display import display
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.ranking import ranking_table
from selfmodel.cli.output.tables import print_tables
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import ComparatorChoice
from selfmodel.diagnosis.diagnosis import Diagnosis, output_of, to_json
from selfmodel.diagnosis.direct_evidence import DirectEvidence, direct_evidence
from selfmodel.diagnosis.text import (
    detectable_sentences,
    evidence_sentences,
    fit_sentence,
    verdict_sentences,
)
from selfmodel.faults.kind import FaultKind
from selfmodel.files import file_digest
from selfmodel.logs import TrialLog
from selfmodel.logs.results import LogsResult, as_json as values_of
from selfmodel.recovery.recover import diagnose_trials
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import trial_names


def diagnose(options: Diagnose) -> None:
    """Rank hypotheses by how well they predict logged trials, without a robot."""
    start = perf_counter()
    considered = plugins.kinds(options.kinds)
    made = diagnose_logs(
        options.files,
        robot=options.self_model,
        choose_comparator=comparator_choice(options.comparator),
        kinds=considered,
        calibrate=options.calibrate,
        population=options.population,
        generations=options.generations,
        seed=options.seed,
        threads=options.threads,
    )
    found, diagnosis = made.inputs, made.diagnosis
    evidence = direct_evidence(
        diagnosis.explained(found.damaged), made.robot.anatomy, trial_names(found.damaged)
    )
    result = LogsResult(
        robot=made.robot.name,
        model=self_model_digest(made.robot),
        comparator=found.comparator.comparator.name,
        comparator_reason=found.comparator.reason,
        kinds=tuple(kind.name for kind in considered),
        seed=found.seed,
        settings_from=made.explained[0].trial.path,
        logs=tuple(log.trial.path for log in made.explained),
        played_back=tuple(log.trial.path for log in made.played_back),
        intact=tuple(trial.path for trial in found.healthy),
        files={str(path): file_digest(path) for path in options.files},
        calibration=found.calibration.to_dict() if found.calibration else None,
        **output_of(diagnosis),
        evidence=to_json(evidence),
        evaluations=found.search.evaluations,
        distinct_hypotheses=found.search.distinct_hypotheses,
        seconds=perf_counter() - start,
    )
    if options.as_json:
        print_json(values_of(result))
    else:
        _print(values_of(result), diagnosis, evidence)


def _print(
    result: dict[str, Any], diagnosis: Diagnosis, evidence: Sequence[DirectEvidence]
) -> None:
    print_tables(ranking_table(result["diagnosis"]))
    print_lines(
        f"{result['robot']}, {counted(len(result['logs']), 'log')}, "
        f"{result['comparator']}: {result['evaluations']} evaluations by the EA, "
        f"{result['distinct_hypotheses']} distinct hypotheses, {result['seconds']:.1f} s.",
        f"Comparator {result['comparator']}: {result['comparator_reason']}.",
        verdict_sentences(diagnosis),
        fit_sentence(diagnosis),
        *detectable_sentences(diagnosis),
        *evidence_sentences(evidence),
        *(f"from before the failure, not explained: {Path(path)}" for path in result["intact"]),
    )


@dataclass(frozen=True, eq=False)
class DiagnosedLogs:
    """A diagnosis of logs, and what it was made of.

    Attributes:
        explained: Logs of the trials to explain, in order.
        robot: The nominal robot.
        inputs: Trials, comparator, calibration and search.
        diagnosis: The diagnosis.
    """

    explained: tuple[TrialLog, ...]
    robot: Robot
    inputs: LogDiagnosis
    diagnosis: Diagnosis

    @property
    def played_back(self) -> tuple[TrialLog, ...]:
        """Logs without a controller."""
        return tuple(log for log in self.explained if _is_played_back(log))


def diagnose_logs(
    files: Sequence[Path],
    *,
    robot: str | None,
    choose_comparator: ComparatorChoice,
    kinds: Sequence[FaultKind],
    calibrate: bool,
    population: int | None,
    generations: int | None,
    seed: int | None,
    threads: int,
) -> DiagnosedLogs:
    """Returns the diagnosis of logs; prints notes and progress on standard error.

    Args:
        files: The logs, in the order in which the trials were run.
        robot: Self-model instead of that in the logs, as in ``--robot``.
        choose_comparator: Chooses the comparator.
        kinds: Fault kinds to search.
        calibrate: Whether the self-model is fitted to the trials before the failure.
        population: Genomes in a generation; None for the number in the first log.
        generations: Generations; None for the number in the first log.
        seed: Seed of all random numbers; None for that of the first log.
        threads: Threads of the physics; 0 for all processors.

    Raises:
        InputError: A log cannot be used, or no comparator can judge all trials.
    """
    logs = arguments.read_logs(files)
    model = arguments.robot_of_logs(logs, robot)
    failed, healthy = by_stage([log.trial for log in logs])
    used = [log for log in logs if log.trial in failed]
    found = set_up_diagnosis(
        failed,
        healthy,
        robot=model,
        choose_comparator=choose_comparator,
        kinds=kinds,
        settings=_settings(used[0].settings, population, generations),
        seed=seed,
        calibrate=calibrate,
        threads=threads,
    )
    print_notes(*(f"note: {note}" for note in _notes(used)))
    with display() as on_event:
        on_event(found.comparator)
        if found.calibration is not None:
            on_event(found.calibration)
        diagnosis = diagnose_trials(found.damaged, found.search, found.seed, on_event)
    return DiagnosedLogs(tuple(used), model, found, diagnosis)


def _settings(logged: Settings, population: int | None, generations: int | None) -> Settings:
    """Returns the settings of a log with the options that were given."""
    if generations is not None:
        logged = dataclasses.replace(logged, generations=generations)
    return logged if population is None else logged.scaled(population)


def _is_played_back(log: TrialLog) -> bool:
    return isinstance(log.trial.plan.controller, Playback)


def _notes(logs: list[TrialLog]) -> list[str]:
    """Returns the notes on limits of the logs that affect the ranking."""
    first = logs[0]
    notes = [
        f"{log.trial.path} has no controller: its commands are played back, so a sensor fault "
        f"does not change the motion"
        for log in logs
        if _is_played_back(log)
    ]
    notes += [
        f"{log.trial.path}: {log.timing.late.sum()} of "
        f"{counted(log.trial.behaviour.steps, 'step')} were late; comparators of short segments "
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
