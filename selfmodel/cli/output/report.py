"""Outcome of ``selfmodel recover``, as text and as JSON."""

import dataclasses
import math
from pathlib import Path
from typing import Any

from selfmodel import plugins
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_lines
from selfmodel.cli.output.ranking import ranking_table
from selfmodel.cli.output.tables import folding, print_tables
from selfmodel.diagnosis.diagnosis import Diagnosis, output_of
from selfmodel.diagnosis.text import right_or_wrong, verdict_sentences
from selfmodel.logs.results import RecoveryResult, ScoreResult, TrialResult
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.robot.designs import network_for
from selfmodel.studies.experiment import Experiment, Outcome


def print_report(found: dict[str, Any], diagnosis: Diagnosis, folder: Path) -> None:
    """Prints the trials, the diagnosis, and the true hypothesis.

    Args:
        found: Result of ``recovery_result`` as JSON values.
        diagnosis: The last diagnosis.
        folder: Folder of the recovery.
    """
    score = found["score"]
    column, key = _column(score)
    trials = folding(
        ("trial", "best hypothesis so far", column),
        [(trial["stage"], trial["hypothesis"], _result(trial, key)) for trial in found["trials"]],
        title="physical trials",
        texts=2,
    )
    print_tables(trials, ranking_table(found["diagnosis"], found["truth"]))
    evaluations, trials_since = found["evaluations"], found["physical_trials"]
    print_lines(
        f"truth: {found['truth']}{_reality(found)}; the diagnosis is "
        f"{right_or_wrong(str(diagnosis.best), found['truth'], correct=found['correct'])}.",
        verdict_sentences(diagnosis),
        f"{_sentence(found)} at best in {counted(trials_since, 'trial')} since.",
        *_no_recovery(found),
        f"{evaluations['repair']} controllers and {evaluations['distinct_hypotheses']} distinct "
        f"hypotheses in {found['seconds']:.0f} s; diverged: {evaluations['diverged']}.",
        f"Logs: {folder}",
    )


def _column(score: dict[str, Any]) -> tuple[str, str]:
    """Returns the title of the column of results, and their key in the trials."""
    if score["name"] == DISPLACEMENT.name:
        return "forward, m", "displacement"
    return f"{score['name']}, {score['unit']}".removesuffix(", "), "score"


def _sentence(found: dict[str, Any]) -> str:
    """Returns the result of the trials, up to "at best"."""
    score = found["score"]
    if score["name"] == DISPLACEMENT.name:
        before, after, recovered = (f"{value:.2f} m" for value in found["displacement"].values())
        return f"The robot went {before} before, {after} after the failure, and {recovered}"
    before, after, recovered = (
        f"{score[when]:.4f} {score['unit']}".rstrip() for when in ("before", "after", "recovered")
    )
    return (
        f"The score {score['name']} was {before} before, {after} after the failure, and {recovered}"
    )


def _result(trial: dict[str, Any], key: str) -> str:
    """Returns the result of a trial, with its early end or its fall."""
    fall = trial["fell_at_step"]
    end = f", ended at step {trial['steps']}" if trial["ended_early"] else ""
    return f"{trial[key]:.3f}" + ("" if fall is None else f", fell at step {fall}") + end


def _no_recovery(found: dict[str, Any]) -> list[str]:
    """Returns a sentence if the robot fell in its best trial."""
    return ["The robot fell in that trial, which is no recovery."] if found["fell"] else []


def _reality(found: dict[str, Any]) -> str:
    """Returns the reality gap of the physical robot as a clause."""
    return f", at a reality gap of {found['gap']:g}" if found["gap"] else ""


def recovery_result(experiment: Experiment, outcome: Outcome) -> RecoveryResult:
    """Returns the outcome of a recovery as ``recover --json`` prints it."""
    recovery, stats, gaits = outcome.recovery, outcome.stats, experiment.repertoire
    design = experiment.design or network_for(experiment.robot)
    return RecoveryResult(
        robot=experiment.robot.name,
        model=self_model_digest(experiment.robot),
        case=experiment.case,
        truth=str(experiment.truth),
        comparator=recovery.comparator.comparator.name,
        comparator_reason=recovery.comparator.reason,
        kinds=tuple(kind.name for kind in experiment.kinds),
        gap=experiment.gap,
        next_trial=experiment.next_trial,
        repair=experiment.repair,
        search=plugins.search_name(experiment.repair, experiment.search, gaits),
        repertoire=dataclasses.asdict(gaits.origin) if gaits else None,
        controller=design.name,
        neurons=design.hidden,
        seed=experiment.seed,
        trials=tuple(
            TrialResult(
                log=trial.path,
                stage=trial.plan.stage,
                displacement=trial.displacement,
                steps=trial.behaviour.steps,
                ended_early=trial.early_end != "",
                score=score,
                predicted_score=predicted if math.isfinite(predicted) else None,
                fell_at_step=fall,
                hypothesis=str(tried),
            )
            for trial, tried, score, predicted, fall in zip(
                recovery.trials,
                recovery.tried,
                recovery.scores,
                recovery.predicted,
                recovery.falls,
                strict=True,
            )
        ),
        **output_of(recovery.diagnosis),
        calibration=recovery.calibration.to_dict() if recovery.calibration else None,
        correct=outcome.correct,
        displacement={
            "before": recovery.before,
            "after": recovery.after,
            "recovered": recovery.recovered,
        },
        score=ScoreResult(
            recovery.score.name,
            recovery.score.unit,
            recovery.scores[0],
            recovery.scores[1],
            recovery.best_score,
        ),
        fell=recovery.fell,
        recovery=recovery.recovered / recovery.before if recovery.before > 0 else None,
        physical_trials=len(recovery.trials) - 2,
        evaluations={
            "repair": recovery.repair_evaluations,
            "diagnostic": recovery.diagnostic_evaluations,
            "distinct_hypotheses": recovery.distinct_hypotheses,
            "simulated_steps": stats.steps,
            "diverged": stats.diverged,
        },
        seconds=outcome.seconds,
    )
