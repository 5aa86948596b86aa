"""``selfmodel suite run``: many bodies fail in the ways of Table I, and recover."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selfmodel.cli.options import ComparatorName, ControllerKind, Generations, Json, Population
from selfmodel.comparators import DEFAULT

if TYPE_CHECKING:
    from selfmodel.experiments.suite.rows import Summary

COLUMNS = (
    *("robot", "case", "truth", "right", "before", "after", "recovered", "recovered ÷ before"),
    *("trials", "seconds"),
)


def run(
    *,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder of the runs; one that was stopped goes on."
        ),
    ],
    domains: Annotated[
        str,
        typer.Option(
            metavar="A,B,ROBOT.xml|all", help="As `selfmodel suite list` has them, or MJCF files."
        ),
    ] = "all",
    tasks: Annotated[
        str | None,
        typer.Option(metavar="A,B|all", help="Tasks.", show_default="the first of each domain"),
    ] = None,
    cases: Annotated[
        str, typer.Option(metavar="1,7|all", help="Failures like those of the paper's Table I.")
    ] = "all",
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each body and case.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The first of their seeds.")] = 0,
    score: Annotated[
        str,
        typer.Option(
            metavar="displacement|return",
            help="What controllers are evolved for: the way forward, or the task's own rewards.",
        ),
    ] = "displacement",
    controller: ControllerKind = "network",
    comparator: ComparatorName = DEFAULT.name,
    steps: Annotated[
        int | None,
        typer.Option(
            min=2, help="Control steps of a trial.", show_default="1000, an episode of the suite"
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    trials: Annotated[
        int, typer.Option(min=1, max=99, help="Physical trials after the failing one.")
    ] = 3,
    workers: Annotated[
        int, typer.Option(min=0, max=1024, help="Processes; 0 means one for each processor.")
    ] = 0,
    as_json: Json = False,
) -> None:
    """Let bodies of the suite, ours and your own fail and recover: bodies x cases x seeds."""
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.cli import lists  # noqa: PLC0415
    from selfmodel.cli.output import grid_command  # noqa: PLC0415
    from selfmodel.experiments.suite.bodies import DOMAINS, bodies, tasks_of  # noqa: PLC0415
    from selfmodel.experiments.suite.plan import Study, known_cases  # noqa: PLC0415
    from selfmodel.experiments.suite.results import write_results  # noqa: PLC0415
    from selfmodel.experiments.suite.work import run_study  # noqa: PLC0415
    from selfmodel.settings import Settings  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415

    asked = lists.texts("--domains", domains, DOMAINS)
    wanted = None if tasks is None else lists.texts("--tasks", tasks, tasks_of(asked))
    chosen = bodies(asked, wanted)
    # A last sample without a consequence: an episode of the suite has 1000 rewards.
    length = steps if steps is not None else 1001 if score == "return" else 1000
    study = Study(
        bodies=chosen,
        cases=lists.whole_numbers("--cases", cases, known_cases(chosen)),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(steps=length, trials=trials, generations=generations).scaled(population),
        score=score,
        controller=controller,
        comparator=comparator,
    )
    failed = grid_command.run_shown(
        lambda on_progress: run_study(
            study, workers=thread_count(workers), on_progress=on_progress
        ),
        out,
    )
    results = write_results(out)
    if as_json:
        found = {**results.as_dict(), "failures": grid_command.as_objects(failed)}
        typer.echo(json.dumps(found, indent=1, allow_nan=False))
    else:
        _print(results.summaries)
        for path in results.files:
            typer.echo(str(path))
    grid_command.end(failed)


def _print(summaries: "tuple[Summary, ...]") -> None:
    from selfmodel.cli.output.tables import show  # noqa: PLC0415  # only where a table is drawn

    if summaries:
        show(COLUMNS, [_texts(summary) for summary in summaries], texts=3)
        typer.echo("Medians over the runs; right with its 95 % interval, %.")


def _texts(summary: "Summary") -> list[str]:
    share = summary.correct
    return [
        summary.robot,
        "single faults" if summary.case is None else str(summary.case),
        summary.truth,
        f"{summary.right} of {summary.runs} ({100 * share.low:.0f} to {100 * share.high:.0f})",
        *(f"{value:.2f}" for value in (summary.before, summary.after, summary.recovered)),
        "-" if summary.recovery is None else f"{summary.recovery:.2f}",
        f"{summary.trials:.0f}",
        f"{summary.seconds:.0f}",
    ]
