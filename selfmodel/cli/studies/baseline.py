"""``selfmodel baseline``: other methods of recovery on the same physical robots."""

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    CONTROLLER,
    SEARCH,
    STUDY,
    ExecutorName,
    ExecutorOptions,
    FirstSeed,
    GapLevels,
    Json,
    Only,
    Population,
    Seeds,
    Steps,
    StudyFolder,
    Workers,
)
from selfmodel.cli.arguments.table_options import OtherTableFormat
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.errors import InputError
from selfmodel.experiments.baseline.plan import BaselineStudy, cells
from selfmodel.experiments.baseline.results import (
    AFTER,
    BaselineSummary,
    write_results,
)
from selfmodel.experiments.comparison.files import write_tables
from selfmodel.experiments.comparison.table_formats import Table, check_format
from selfmodel.experiments.grid.executors import PROCESSES
from selfmodel.recovery.baselines.problem import BaselineSettings
from selfmodel.recovery.baselines.registry import BASELINES
from selfmodel.tasks import ROBOTS

COLUMNS = (
    *("robot", "case", "gap", "method", "runs"),
    *(f"m after {trials}" for trials in AFTER),
    *(f"÷ oracle after {trials}" for trials in AFTER),
    *("trials", "simulated steps", "seconds"),
)


def baseline(
    *,
    out: StudyFolder,
    methods: Annotated[
        str,
        typer.Option(
            metavar="A,B|all",
            help=f"Methods: {', '.join(BASELINES)}.",
            rich_help_panel=STUDY,
        ),
    ] = "all",
    robots: Annotated[
        str, typer.Option(metavar="A,B|all", help="Robots.", rich_help_panel=STUDY)
    ] = "all",
    cases: Annotated[
        str,
        typer.Option(
            "--case",
            metavar="1,2",
            help="Failures of the paper's Table I, by number.",
            rich_help_panel=STUDY,
        ),
    ] = "1,2,4,6",
    gaps: GapLevels = "0.1",
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    only: Only = "1/1",
    table: Annotated[
        bool, typer.Option("--table", help="Run nothing, and print the table of finished runs.")
    ] = False,
    table_format: OtherTableFormat = None,
    steps: Steps = 1000,
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            max=1000,
            metavar="N",
            help="Physical trials of a method, apart from the oracle and evolution.",
            rich_help_panel=CONTROLLER,
        ),
    ] = 20,
    evolution_trials: Annotated[
        int,
        typer.Option(
            min=1,
            max=10**6,
            metavar="N",
            help="Physical trials of evolution on the physical robot.",
            rich_help_panel=CONTROLLER,
        ),
    ] = 500,
    evaluations: Annotated[
        int,
        typer.Option(
            min=1,
            max=10**7,
            metavar="N",
            help="Evaluations of each search in simulation.",
            rich_help_panel=SEARCH,
        ),
    ] = 6000,
    population: Population = 100,
    period: Annotated[
        int,
        typer.Option(
            min=1,
            max=10_000,
            metavar="N",
            help="Generations of T-Resilience between two physical trials.",
            rich_help_panel=SEARCH,
        ),
    ] = 40,
    repertoire_evaluations: Annotated[
        int,
        typer.Option(
            min=1,
            max=10**8,
            metavar="N",
            help="Evaluations of the search for the repertoire of a robot.",
            rich_help_panel=SEARCH,
        ),
    ] = 60_000,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    executor_option: ExecutorOptions = "",
    as_json: Json = False,
) -> None:
    """Recover by other methods, and find what the damaged body can do: the oracle.

    Each method has the same damaged physical robots as `selfmodel recover` with the same seed and
    gap. An interrupted study is continued by the same command.
    """
    if table_format is not None:
        check_format(table_format)
    if table and not (out / "runs").is_dir():
        raise InputError(
            f"{out}: expected the folder of a study with finished runs, got none: run the study "
            f"first, without --table"
        )
    study = BaselineStudy(
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=inputs.whole_numbers("--case", cases, ()),
        gaps=inputs.numbers("--gap", gaps),
        seeds=range(seed, seed + seeds),
        methods=inputs.texts("--methods", methods, BASELINES),
        folder=out,
        settings=BaselineSettings(
            trials=trials, evaluations=evaluations, population=population, period=period
        ),
        steps=steps,
        evolution_trials=evolution_trials,
        repertoire_evaluations=repertoire_evaluations,
    )
    share = inputs.share("--only", only)
    failed = (
        ()
        if table
        else grid_display.run_shown(
            cells(study, share), out, executor=executor, options=executor_option, workers=workers
        )
    )
    results = write_results(out)
    found_table = _table(results.summaries)
    tables = write_tables(out, [found_table], table_format)
    files = [str(path) for path in (*results.files, *tables)]
    if as_json:
        failures = grid_display.as_objects(failed)
        print_json({**results.as_dict(), "failures": failures, "files": files}, indent=1)
    else:
        _print(found_table)
        print_lines(*files)
    grid_display.end(failed)


def _print(table: Table) -> None:
    if table.rows:
        show(table.columns, table.rows, texts=table.texts)
        print_lines(
            "Medians over the seeds; metres up to the first fall, of the best trial so far; of the "
            "oracle, the mean of its trials."
        )


def _table(summaries: Sequence[BaselineSummary]) -> Table:
    records = [_record(summary) for summary in summaries]
    names = tuple(records[0]) if records else ()
    rows = [_texts(summary) for summary in summaries]
    return Table("summaries", names, records, COLUMNS, rows, texts=4)


def _record(summary: BaselineSummary) -> dict[str, Any]:
    """Returns a summary with a column per number of trials."""
    found = dataclasses.asdict(summary)
    values, ratios = found.pop("values"), found.pop("ratios") or [None] * len(AFTER)
    for name, own in (("m_after", values), ("ratio_after", ratios)):
        found |= {f"{name}_{trials}": one for trials, one in zip(AFTER, own, strict=True)}
    return found


def _texts(summary: BaselineSummary) -> list[str]:
    ratios = ["-"] * len(AFTER)
    if summary.ratios is not None:
        ratios = [f"{ratio:.2f}" for ratio in summary.ratios]
    return [
        summary.robot,
        str(summary.case),
        f"{summary.gap:g}",
        summary.method,
        str(summary.runs),
        *(f"{value:.2f}" for value in summary.values),
        *ratios,
        f"{summary.trials:g}",
        f"{summary.simulated_steps:.3g}",
        f"{summary.seconds:.0f}",
    ]
