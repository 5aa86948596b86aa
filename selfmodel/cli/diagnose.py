"""``selfmodel diagnose``: hypotheses ranked by how well they predict logged trials."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from selfmodel import plugins
from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.cli.arguments.options import (
    DEFAULT_KIND_NAMES,
    Calibrated,
    ComparatorName,
    Json,
    KindNames,
    LogFiles,
    LoggedGenerations,
    LoggedPopulation,
    LoggedSeed,
    SelfModel,
    Threads,
)
from selfmodel.cli.diagnosed_logs import diagnose_logs
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.ranking import ranking_table
from selfmodel.cli.output.tables import print_tables
from selfmodel.diagnosis.diagnosis import Diagnosis, output_of, to_json
from selfmodel.diagnosis.direct_evidence import DirectEvidence, direct_evidence
from selfmodel.diagnosis.text import (
    detectable_sentences,
    evidence_sentences,
    fit_sentence,
    verdict_sentences,
)
from selfmodel.files import file_digest
from selfmodel.logs.results import LogsResult, as_json as values_of
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.trials.trial import trial_names


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
    as_json: Json = False,
) -> None:
    """Rank hypotheses by how well they predict logged trials, without a robot.

    Give the logs in the order in which the trials were run. The self-model is fitted to the
    trials from before the failure, and the hypotheses predict all others.
    """
    start = perf_counter()
    considered = plugins.kinds(kinds)
    made = diagnose_logs(
        files,
        robot=robot,
        choose_comparator=comparator_choice(comparator),
        kinds=considered,
        calibrate=calibrate,
        population=population,
        generations=generations,
        seed=seed,
        threads=threads,
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
        files={str(path): file_digest(path) for path in files},
        calibration=found.calibration.to_dict() if found.calibration else None,
        **output_of(diagnosis),
        evidence=to_json(evidence),
        evaluations=found.search.evaluations,
        distinct_hypotheses=found.search.distinct_hypotheses,
        seconds=perf_counter() - start,
    )
    if as_json:
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
