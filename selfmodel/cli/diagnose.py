"""``selfmodel diagnose``: hypotheses ranked by how well they predict logged trials."""

import dataclasses
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from selfmodel.cli.confirmation import confirm_time
from selfmodel.cli.options import (
    DEFAULT_BUDGET,
    DEFAULT_KIND_NAMES,
    Calibrated,
    ComparatorName,
    FileBudget,
    Json,
    KindNames,
    LogFiles,
    LoggedGenerations,
    LoggedPopulation,
    LoggedSeed,
    SelfModel,
    Threads,
    Yes,
)
from selfmodel.cli.output.display import display
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.ranking import (
    confidence_sentence,
    detectable_sentences,
    evidence_sentences,
    fit_sentence,
    ranking_table,
)
from selfmodel.cli.output.tables import print_tables
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.serialization import confidence_to_dict, ranking_to_list
from selfmodel.diagnosis.verdicts.direct_evidence import direct_evidence
from selfmodel.experiments import plugins, trial_logs
from selfmodel.experiments.arguments import AUTO, comparator_choice
from selfmodel.experiments.expected_time import diagnosis_seconds
from selfmodel.experiments.log_diagnosis import by_stage, set_up_diagnosis
from selfmodel.logs import TrialLog
from selfmodel.recovery.sequential_diagnosis import diagnose_trials
from selfmodel.sandbox.budget import Budget
from selfmodel.settings import Settings
from selfmodel.trials.trial_names import trial_names


def diagnose(
    files: LogFiles,
    *,
    robot: SelfModel = None,
    comparator: ComparatorName = AUTO,
    kinds: KindNames = DEFAULT_KIND_NAMES,
    calibrate: Calibrated = True,
    population: LoggedPopulation = None,
    generations: LoggedGenerations = None,
    seed: LoggedSeed = None,
    threads: Threads = 0,
    budget: FileBudget = DEFAULT_BUDGET,
    yes: Yes = False,
    as_json: Json = False,
) -> None:
    """Rank hypotheses by how well they predict logged trials, without a robot.

    Give the logs in the order in which the trials were run. The self-model is fitted to the
    trials from before the failure, and the hypotheses predict all others.
    """
    start = perf_counter()
    choice = comparator_choice(comparator)
    considered = plugins.kinds(kinds)
    allowed = Budget.parse(budget)
    logs = trial_logs.logs(files, allowed)
    model = trial_logs.robot_of_logs(logs, robot, allowed)
    failed, healthy = by_stage([log.trial for log in logs])
    used = [log for log in logs if log.trial in failed]
    first = used[0]
    set_up = partial(
        set_up_diagnosis,
        failed,
        healthy,
        robot=model,
        choose_comparator=choice,
        kinds=considered,
        settings=_settings(first.settings, population, generations),
        seed=seed,
        threads=threads,
        budget=allowed,
    )
    expected = diagnosis_seconds(
        model, set_up(calibrate=False), calibrate=calibrate, threads=threads, budget=allowed
    )
    confirm_time(expected, allowed, yes=yes)
    found = set_up(calibrate=calibrate)
    print_notes(*(f"note: {note}" for note in _notes(used)))
    with display() as on_event:
        on_event(found.comparator)
        if found.calibration is not None:
            on_event(found.calibration)
        diagnosis = diagnose_trials(found.damaged, found.search, found.seed, on_event)
    result = {
        "robot": model.name,
        "comparator": found.comparator.comparator.name,
        "comparator_reason": found.comparator.reason,
        "kinds": [kind.name for kind in considered],
        "seed": found.seed,
        "settings_from": first.trial.path,
        "logs": [log.trial.path for log in used],
        "played_back": [log.trial.path for log in used if _is_played_back(log)],
        "intact": [trial.path for trial in found.healthy],
        "calibration": found.calibration.to_dict() if found.calibration else None,
        "diagnosis": ranking_to_list(diagnosis.ranked),
        **confidence_to_dict(diagnosis),
        "evidence": [
            one.to_dict()
            for one in direct_evidence(
                diagnosis.explained(found.damaged), model.anatomy, trial_names(found.damaged)
            )
        ],
        "evaluations": found.search.evaluations,
        "distinct_hypotheses": found.search.distinct_hypotheses,
        "seconds": perf_counter() - start,
    }
    if as_json:
        print_json(result)
    else:
        _print(result)


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


def _print(result: dict[str, Any]) -> None:
    print_tables(ranking_table(result["diagnosis"]))
    print_lines(
        f"{result['robot']}, {counted(len(result['logs']), 'log')}, "
        f"{result['comparator']}: {result['evaluations']} evaluations by the EA, "
        f"{result['distinct_hypotheses']} distinct hypotheses, {result['seconds']:.1f} s.",
        f"Comparator {result['comparator']}: {result['comparator_reason']}.",
        confidence_sentence(result),
        fit_sentence(result),
        *detectable_sentences(result),
        *evidence_sentences(result),
        *(f"from before the failure, not explained: {Path(path)}" for path in result["intact"]),
    )
