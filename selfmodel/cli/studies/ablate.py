"""``selfmodel ablate``: rates of correct diagnoses per comparator and reality gap."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    CONTROLLER,
    DEFAULT_KIND_NAMES,
    STUDY,
    Cases,
    ComparatorNames,
    Damages,
    ExecutorName,
    ExecutorOptions,
    FirstSeed,
    GapLevels,
    Generations,
    Json,
    KindNames,
    Only,
    Population,
    Seeds,
    Steps,
    StudyFolder,
    Workers,
)
from selfmodel.cli.arguments.repair_options import RepairName, StudyScore, StudySearch
from selfmodel.cli.arguments.table_options import TableFormat
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.experiments.ablation import Ablation, AblationResults, write_results
from selfmodel.experiments.ablation.plan import cells
from selfmodel.experiments.ablation.results import as_dict
from selfmodel.experiments.ablation.scores import ComparatorScore
from selfmodel.experiments.comparison.files import write_tables
from selfmodel.experiments.comparison.loaded_study import whole
from selfmodel.experiments.comparison.outcomes import of_ablation
from selfmodel.experiments.comparison.table_formats import Table, check_format
from selfmodel.experiments.comparison.tables import table_of_records
from selfmodel.experiments.confidence_intervals import Interval
from selfmodel.experiments.grid.checks import read_study
from selfmodel.experiments.grid.executors import PROCESSES
from selfmodel.experiments.statistics import balance_warnings, imbalances
from selfmodel.experiments.study.repair_cost import repair_cost
from selfmodel.faults.registry import kind_names
from selfmodel.plugins import PAPER
from selfmodel.settings import Settings
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
    repair: RepairName = PAPER,
    search: StudySearch = None,
    score: StudyScore = None,
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
    executor: ExecutorName = PROCESSES,
    executor_option: ExecutorOptions = "",
    only: Only = "1/1",
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds.

    The results are the rates of correct diagnoses, with 95 % intervals. An interrupted ablation
    is continued by the same command.
    """
    if table is not None:
        check_format(table)
    cases = cases.strip()
    numbers = () if cases in ("all", "none") else inputs.whole_numbers("--case", cases, ())
    ablation = Ablation(
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=None if cases == "all" else numbers,
        damages=[damage.strip() for damage in damages.split(",") if damage.strip()],
        kinds=kind_names(kinds),
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        gaps=inputs.numbers("--gap", gaps),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
        next_trial=next_trial,
        bank=bank,
        score=score,
        repair=repair,
        search=search,
    )
    part = inputs.share("--only", only)
    planned = cells(ablation, part)
    if repair != PAPER:
        repairs = 0 if next_trial == "bank" else trials - 1
        cost = repair_cost(planned, ablation.settings, repair, repairs, read_study(out))
        if cost.steps:
            print_notes(f"note: {cost}")
    failed = grid_display.run_shown(
        planned, out, executor=executor, options=executor_option, workers=workers
    )
    results = write_results(out)
    tables = write_tables(out, [_table(results.scores)], table)
    files = [str(path) for path in (*results.files, *tables)]
    if as_json:
        found = {
            **as_dict(results.rows, results.scores),
            "failures": grid_display.as_objects(failed),
            "files": files,
        }
        print_json(found, indent=1)
    else:
        _print(results)
        print_lines(*files)
    grid_display.end(failed)


def _print(results: AblationResults) -> None:
    ends = {score.trials for score in results.scores}
    shown = _table([score for score in results.scores if score.trials in (min(ends), max(ends))])
    if shown.rows:
        show(shown.columns, shown.rows, texts=shown.texts)
        print_lines("With 95 % intervals; time as a multiple of the paper's comparator's.")
    unbalanced = balance_warnings(imbalances(whole(of_ablation(results.rows))))
    print_notes(*(f"warning: {warning}" for warning in unbalanced))


def _table(scores: Sequence[ComparatorScore]) -> Table:
    columns = ["robot", "gap", "comparator", "trials", "right", "right, %", "time"]
    if any(score.recovery for score in scores):
        columns.append("recovered ÷ before")
    rows = [_texts(score)[: len(columns)] for score in scores]
    return table_of_records("scores", scores, columns, rows, texts=3)


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
