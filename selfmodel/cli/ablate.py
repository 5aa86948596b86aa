"""``selfmodel ablate``: which comparator is right, how often, at which reality gap."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import (
    DEFAULT_KINDS,
    Generations,
    Json,
    KindNames,
    Population,
    Structural,
)

if TYPE_CHECKING:
    from selfmodel.experiments.ablation import AblationResults
    from selfmodel.experiments.ablation.scores import ComparatorScore
    from selfmodel.experiments.confidence_intervals import Interval


def ablate(
    *,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder of the ablation; one that was stopped goes on."
        ),
    ],
    robots: Annotated[str, typer.Option(metavar="A,B|all", help="Robots.")] = "all",
    cases: Annotated[
        str, typer.Option(metavar="1,7|all|none", help="Failures of the paper's Table I.")
    ] = "all",
    damages: Annotated[
        str, typer.Option(metavar="NOTATION,...", help="Further failures, in notation.")
    ] = "",
    kinds: KindNames = DEFAULT_KINDS,
    comparators: Annotated[
        str, typer.Option(metavar="A,B|all", help="Names, or package.module:object.")
    ] = "all",
    gaps: Annotated[str, typer.Option(metavar="0,0.05", help="Levels of the reality gap.")] = "0",
    structure: Structural = False,
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each robot, case and gap.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The first of their seeds.")] = 0,
    next_trial: Annotated[
        str,
        typer.Option(
            metavar="bank|repair|disagreement", help="How the trials' controllers are chosen."
        ),
    ] = "bank",
    trials: Annotated[
        int, typer.Option(min=1, max=99, help="Physical trials of the damaged robot.")
    ] = 3,
    bank: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Gaits, ROBOT-0.npz to ROBOT-5.npz.", show_default="evolved"
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    workers: Annotated[
        int, typer.Option(min=0, max=1024, help="Processes; 0 means one for each processor.")
    ] = 0,
    only: Annotated[
        str, typer.Option(metavar="i/n", help="Only share i of n of the runs, for n machines.")
    ] = "1/1",
    as_json: Json = False,
) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds, with intervals."""
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.cli import lists  # noqa: PLC0415
    from selfmodel.cli.output import grid_command  # noqa: PLC0415
    from selfmodel.comparators import COMPARATORS  # noqa: PLC0415
    from selfmodel.experiments.ablation import Ablation, write_results  # noqa: PLC0415
    from selfmodel.experiments.ablation import ablate as run  # noqa: PLC0415
    from selfmodel.experiments.ablation.results import as_dict  # noqa: PLC0415
    from selfmodel.settings import Settings  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415
    from selfmodel.tasks import ROBOTS  # noqa: PLC0415

    cases = cases.strip()
    numbers = () if cases in ("all", "none") else lists.whole_numbers("--cases", cases, ())
    ablation = Ablation(
        robots=lists.texts("--robots", robots, ROBOTS),
        cases=None if cases == "all" else numbers,
        damages=[damage.strip() for damage in damages.split(",") if damage.strip()],
        kinds=kinds,
        structure=structure,
        comparators=lists.texts("--comparators", comparators, COMPARATORS),
        gaps=lists.numbers("--gaps", gaps),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(trials=trials, generations=generations).scaled(population),
        next_trial=next_trial,
        bank=bank,
    )
    part = lists.share("--only", only)
    failed = grid_command.run_shown(
        lambda on_progress: run(
            ablation, workers=thread_count(workers), on_progress=on_progress, only=part
        ),
        out,
    )
    results = write_results(out)
    if as_json:
        found = {
            **as_dict(results.rows, results.scores),
            "failures": grid_command.as_objects(failed),
        }
        typer.echo(json.dumps(found, indent=1, allow_nan=False))
    else:
        _print(results)
    grid_command.end(failed)


def _print(results: "AblationResults") -> None:
    from selfmodel.cli.output.tables import show  # noqa: PLC0415  # only where a table is drawn

    ends = {score.trials for score in results.scores}
    rows = [_texts(score) for score in results.scores if score.trials in (min(ends), max(ends))]
    columns = ["robot", "gap", "comparator", "trials", "right", "right, %", "time"]
    if any(score.recovery for score in results.scores):
        columns.append("recovered ÷ before")
    if rows:
        show(columns, [row[: len(columns)] for row in rows], texts=3)
        typer.echo("With 95 % intervals; time as a multiple of the paper's comparator's.")
    for path in results.files:
        typer.echo(str(path))


def _texts(score: "ComparatorScore") -> list[str]:
    share = score.correct
    return [
        score.robot,
        f"{score.gap:g}",
        score.comparator,
        str(score.trials),
        f"{score.right} of {score.runs}",
        f"{100 * share.estimate:.0f} ({100 * share.low:.0f} to {100 * share.high:.0f})",
        _ratio(score.time),
        _ratio(score.recovery),
    ]


def _ratio(interval: "Interval | None") -> str:
    if interval is None:
        return "-"
    ends: Any = (interval.low, interval.high)
    known = all(end == end for end in ends)  # noqa: PLR0124  # NaN is not itself
    return f"{interval.estimate:.2f}" + (f" ({ends[0]:.2f} to {ends[1]:.2f})" if known else "")
