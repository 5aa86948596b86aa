"""``selfmodel paper``: the paper's experiment, as tables and figures beside what it reports."""

from collections.abc import Sequence
from typing import Annotated

import typer

from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    STUDY,
    Cases,
    ComparatorNames,
    ExecutorName,
    ExecutorOptions,
    FirstSeed,
    Generations,
    Json,
    Population,
    Seeds,
    Steps,
    StudyFolder,
    Trials,
    Workers,
)
from selfmodel.cli.arguments.table_options import TableFormat
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.experiments.comparison.files import write_tables
from selfmodel.experiments.comparison.table_formats import Table, check_format
from selfmodel.experiments.comparison.tables import table_of_records
from selfmodel.experiments.grid.executors import PROCESSES
from selfmodel.experiments.paper.plan import (
    COMPARATORS as PAPER_COMPARATORS,
    PaperStudy,
    cells,
)
from selfmodel.experiments.paper.reported import FAILURES
from selfmodel.experiments.paper.results import PaperResults, write_results
from selfmodel.experiments.paper.tables import CaseSummary, Failure
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS

COLUMNS = (
    *("robot", "case", "comparator", "the paper", "right", "before", "after", "recovered"),
    "÷ before",
)
DEFAULT_COMPARATORS = ",".join(PAPER_COMPARATORS)


def paper(
    *,
    out: StudyFolder,
    robots: Annotated[
        str,
        typer.Option(metavar="A,B|all", help="The paper's robots.", rich_help_panel=STUDY),
    ] = "all",
    cases: Cases = "all",
    comparators: ComparatorNames = DEFAULT_COMPARATORS,
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    steps: Steps = 1000,
    trials: Trials = 3,
    population: Population = 100,
    generations: Generations = 30,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    executor_option: ExecutorOptions = "",
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown.

    Each case is recovered with each comparator, and by evolution on the robot, the paper's
    control. An interrupted experiment is continued by the same command.
    """
    if table is not None:
        check_format(table)
    study = PaperStudy(
        folder=out,
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=inputs.whole_numbers("--case", cases, FAILURES),
        seeds=range(seed, seed + seeds),
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
    )
    failed = grid_display.run_shown(
        cells(study), out, executor=executor, options=executor_option, workers=workers
    )
    results = write_results(out)
    second = _second(results.summaries)
    tables = write_tables(out, [_first(results.failures), second, _costs(results)], table)
    files = [str(path) for path in (*results.files, *tables)]
    if as_json:
        failures = grid_display.as_objects(failed)
        print_json({**results.as_dict(), "failures": failures, "files": files}, indent=1)
    else:
        _print(second)
        print_lines(*files)
    grid_display.end(failed)


def _print(table: Table) -> None:
    if table.rows:
        show(table.columns, table.rows, texts=table.texts)
        print_lines("Medians over the runs, m; the paper: whether it reports the case as restored.")


def _first(failures: Sequence[Failure]) -> Table:
    columns = ("case", "failure", "robot", "truth")
    rows = [[str(one.case), one.failure, one.robot, one.truth] for one in failures]
    return table_of_records("table-1", failures, columns, rows, texts=4)


def _second(summaries: Sequence[CaseSummary]) -> Table:
    rows = [_texts(summary) for summary in summaries]
    return table_of_records("table-2", summaries, COLUMNS, rows, texts=4)


def _costs(results: PaperResults) -> Table:
    columns = ("robot", "way", "physical trials", "n", "÷ before", "first quartile", "third")
    rows = [
        [
            *(cost.robot, cost.way, str(cost.physical_trials), str(cost.runs)),
            *(f"{value:.2f}" for value in (cost.recovery, cost.low, cost.high)),
        ]
        for cost in results.costs
    ]
    return table_of_records("costs", results.costs, columns, rows, texts=2)


def _texts(summary: CaseSummary) -> list[str]:
    return [
        summary.robot,
        str(summary.case),
        summary.comparator,
        "restored" if summary.restored_in_paper else "not restored",
        f"{summary.right} of {summary.runs}",
        *(f"{value:.2f}" for value in (summary.before, summary.after, summary.recovered)),
        "-" if summary.recovery is None else f"{summary.recovery:.2f}",
    ]
