"""``selfmodel diagnose``: what is wrong, from logs alone."""

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import (
    DEFAULT_KINDS,
    Calibrated,
    ComparatorName,
    Json,
    KindNames,
    LogFiles,
    RobotOrModel,
    Threads,
)
from selfmodel.comparators import DEFAULT

if TYPE_CHECKING:
    from selfmodel.logs import TrialLog


def diagnose(
    files: LogFiles,
    *,
    robot: RobotOrModel = None,
    comparator: ComparatorName = DEFAULT.name,
    kinds: KindNames = DEFAULT_KINDS,
    calibrate: Calibrated = True,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, help="Every random choice comes from it.", show_default="that of the first log"
        ),
    ] = None,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Rank what may be wrong with a robot by how well it explains logs, with no robot at hand.

    Give the logs in the order in which the trials were run. Trials from before the failure show
    how the robot moves with nothing wrong: the self-model is fitted to them.
    """
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.cli.output.display import display  # noqa: PLC0415
    from selfmodel.diagnosis.diagnose import DiagnosticSearch  # noqa: PLC0415
    from selfmodel.diagnosis.serialization import (  # noqa: PLC0415
        confidence_to_dict,
        ranking_to_list,
    )
    from selfmodel.experiments import plugins, trial_logs  # noqa: PLC0415
    from selfmodel.experiments.fitting import calibration_to_dict, fitted  # noqa: PLC0415
    from selfmodel.recovery.explain import diagnose_trials  # noqa: PLC0415
    from selfmodel.simulation.simulator import Simulator  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415

    start = perf_counter()
    judge = plugins.comparator(comparator)
    considered = plugins.kinds(kinds)
    logs = trial_logs.logs(files)
    model = trial_logs.robot_of_logs(logs, robot)
    used = _since_the_failure(logs)
    first = used[0]
    chosen = first.trial.plan.seed if seed is None else seed
    intact = [log.trial for log in logs if log not in used]
    fit = fitted(model, intact, thread_count(threads)) if calibrate and intact else None
    simulator = Simulator(fit.robot if fit else model, thread_count(threads))
    search = DiagnosticSearch(simulator, judge, first.settings, considered, intact=intact)
    for note in _notes(used):
        typer.echo(f"note: {note}", err=True)
    with display() as on_event:
        if fit:
            on_event(fit)
        diagnosis = diagnose_trials([log.trial for log in used], search, chosen, on_event)
    result = {
        "robot": model.name,
        "comparator": judge.name,
        "kinds": [kind.name for kind in considered],
        "seed": chosen,
        "settings_from": first.trial.path,
        "logs": [log.trial.path for log in used],
        "played_back": [log.trial.path for log in used if _is_played_back(log)],
        "intact": [trial.path for trial in intact],
        "calibration": calibration_to_dict(fit),
        "diagnosis": ranking_to_list(diagnosis.ranked),
        **confidence_to_dict(diagnosis),
        "evaluations": search.evaluations,
        "distinct_hypotheses": search.distinct_hypotheses,
        "seconds": perf_counter() - start,
    }
    if as_json:
        typer.echo(json.dumps(result, indent=2, allow_nan=False))
    else:
        _print(result)


def _is_played_back(log: "TrialLog") -> bool:
    from selfmodel.controllers.playback import Playback  # noqa: PLC0415  # with the other work

    return isinstance(log.trial.plan.controller, Playback)


def _notes(logs: "list[TrialLog]") -> list[str]:
    """What a user should know before reading the ranking."""
    first = logs[0]
    notes = [
        f"{log.trial.path} has no controller: its commands are played back, so a fault of a "
        f"sensor does not show in how it moves"
        for log in logs
        if _is_played_back(log)
    ]
    notes += [
        f"{log.trial.path}: {log.timing.late.sum()} of {log.trial.behaviour.steps} steps were "
        f"late; short predictions leave them out, but a comparator of whole trials cannot"
        for log in logs
        if log.timing is not None and log.timing.late.any()
    ]
    if any(log.settings != first.settings for log in logs):
        notes.append(f"the logs have different settings: those of {first.trial.path} are taken")
    if any(log.trial.plan.seed != first.trial.plan.seed for log in logs):
        notes.append(f"the logs have different seeds: without --seed, that of {first.trial.path}")
    return notes


def _since_the_failure(logs: "list[TrialLog]") -> "list[TrialLog]":
    return [log for log in logs if log.trial.plan.stage != "before"] or logs


def _print(result: dict[str, Any]) -> None:
    from rich.console import Console  # noqa: PLC0415  # only where a table is drawn

    from selfmodel.cli.output.plain import plain  # noqa: PLC0415  # the same
    from selfmodel.cli.output.ranking import in_words, ranking_table  # noqa: PLC0415  # the same

    Console(markup=False).print(ranking_table(result["diagnosis"]))
    count = len(result["logs"])
    typer.echo(
        f"{plain(result['robot'])}, {count} {'log' if count == 1 else 'logs'}, "
        f"{result['comparator']}: {result['evaluations']} evaluations by the EA, "
        f"{result['distinct_hypotheses']} distinct hypotheses, {result['seconds']:.1f} s."
    )
    typer.echo(in_words(result))
    for path in result["intact"]:
        typer.echo(f"from before the failure, not to be explained: {Path(path)}")
