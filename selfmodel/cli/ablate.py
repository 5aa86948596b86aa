"""``selfmodel ablate``: rates of correct diagnoses per comparator and reality gap."""

import math
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli import inputs
from selfmodel.cli.options import (
    CONTROLLER,
    DEFAULT_KIND_NAMES,
    STUDY,
    Cases,
    ComparatorNames,
    Damages,
    FirstSeed,
    GapLevels,
    Generations,
    Json,
    KindNames,
    Only,
    Population,
    Seeds,
    Steps,
    Structural,
    StudyFolder,
    Workers,
)
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.cli.repair_options import ScoreName
from selfmodel.comparators import COMPARATORS
from selfmodel.experiments.ablation import Ablation, AblationResults, ablate as run, write_results
from selfmodel.experiments.ablation.results import as_dict
from selfmodel.experiments.ablation.scores import ComparatorScore
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.faults.registry import kind_names
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.settings import Settings
from selfmodel.simulation.threads import thread_count
from selfmodel.tasks import ROBOTS


def ablate(
    *,
    out: StudyFolder,
    robots: Annotated[
        str, typer.Option(metavar="A,B|all", help="Robots.", rich_help_panel=STUDY)
    ] = "all",
    cases: Cases = "all",
    damages: Damages = "",
    kinds: KindNames = DEFAULT_KIND_NAMES,
    comparators: ComparatorNames = "all",
    gaps: GapLevels = "0",
    structure: Structural = False,
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    next_trial: Annotated[
        str,
        typer.Option(
            metavar="WAY",
            help="Choice of the trials' controllers: bank, the same gaits for all comparators; or "
            "repair or disagreement, as in `selfmodel recover`.",
            rich_help_panel=CONTROLLER,
        ),
    ] = "bank",
    score: ScoreName = DISPLACEMENT.name,
    steps: Steps = 1000,
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            max=99,
            metavar="N",
            help="Physical trials of the damaged robot.",
            rich_help_panel=CONTROLLER,
        ),
    ] = 3,
    bank: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of gaits, ROBOT-0.npz to ROBOT-5.npz.",
            show_default="evolved",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    workers: Workers = 0,
    only: Only = "1/1",
    as_json: Json = False,
) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds.

    The results are the rates of correct diagnoses, with 95 % intervals. An interrupted ablation
    is continued by the same command.
    """
    cases = cases.strip()
    numbers = () if cases in ("all", "none") else inputs.whole_numbers("--case", cases, ())
    ablation = Ablation(
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=None if cases == "all" else numbers,
        damages=[damage.strip() for damage in damages.split(",") if damage.strip()],
        kinds=kind_names(kinds),
        structure=structure,
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        gaps=inputs.numbers("--gap", gaps),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
        next_trial=next_trial,
        bank=bank,
        score=score,
    )
    part = inputs.share("--only", only)
    failed = grid_display.run_shown(
        lambda on_progress: run(
            ablation, workers=thread_count(workers), on_progress=on_progress, only=part
        ),
        out,
    )
    results = write_results(out)
    grid_display.note_unverified(results.unverified, out)
    if as_json:
        found = {
            **as_dict(results.rows, results.scores),
            "failures": grid_display.as_objects(failed),
        }
        print_json(found, indent=1)
    else:
        _print(results)
    grid_display.end(failed)


def _print(results: AblationResults) -> None:
    ends = {score.trials for score in results.scores}
    rows = [_texts(score) for score in results.scores if score.trials in (min(ends), max(ends))]
    columns = ["robot", "gap", "comparator", "trials", "right", "right, %", "time"]
    if any(score.recovery for score in results.scores):
        columns.append("recovered ÷ before")
    if rows:
        show(columns, [row[: len(columns)] for row in rows], texts=3)
        print_lines("With 95 % intervals; time as a multiple of the paper's comparator's.")
    print_lines(*map(str, results.files))


def _texts(score: ComparatorScore) -> list[str]:
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


def _ratio(interval: Interval | None) -> str:
    if interval is None:
        return "-"
    text = f"{interval.estimate:.2f}"
    if math.isnan(interval.low) or math.isnan(interval.high):
        return text
    return f"{text} ({interval.low:.2f} to {interval.high:.2f})"
