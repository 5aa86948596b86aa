"""``selfmodel suite run``: a study in which many bodies fail as in Table I, and recover."""

from typing import Annotated

import typer

from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    CONTROLLER,
    PAPER_KIND_NAMES,
    STUDY,
    Cases,
    ComparatorName,
    ControllerKind,
    ExecutorName,
    ExecutorOptions,
    FirstSeed,
    GapLevel,
    Generations,
    Json,
    KindNames,
    Neurons,
    Only,
    Population,
    Seeds,
    StudyFolder,
    Trials,
    Workers,
)
from selfmodel.cli.arguments.repair_options import RepairName, StudyScore, StudySearch
from selfmodel.cli.arguments.table_options import TableFormat
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.output.tables import show
from selfmodel.comparators import DEFAULT
from selfmodel.experiments.comparison.files import write_tables
from selfmodel.experiments.comparison.table_formats import Table, check_format
from selfmodel.experiments.comparison.tables import table_of_records
from selfmodel.experiments.grid.checks import read_study
from selfmodel.experiments.grid.executors import PROCESSES
from selfmodel.experiments.study.repair_cost import repair_cost
from selfmodel.experiments.suite.bodies import DOMAINS, bodies, tasks_of
from selfmodel.experiments.suite.plan import Study, cells, known_cases
from selfmodel.experiments.suite.results import write_results
from selfmodel.experiments.suite.rows import Summary
from selfmodel.faults.registry import kind_names
from selfmodel.plugins import PAPER
from selfmodel.settings import Settings

COLUMNS = (
    *("robot", "case", "truth", "right", "before", "after", "recovered", "recovered ÷ before"),
    *("upright", "trials", "seconds"),
)


def run(
    *,
    out: StudyFolder,
    domains: Annotated[
        str,
        typer.Option(
            metavar="A,B|all",
            help="Domains that `selfmodel suite list` lists, or MJCF and URDF files.",
            rich_help_panel=STUDY,
        ),
    ] = "all",
    tasks: Annotated[
        str | None,
        typer.Option(
            metavar="A,B|all",
            help="Tasks of the domains.",
            show_default="the first of each domain",
            rich_help_panel=STUDY,
        ),
    ] = None,
    cases: Cases = "all",
    seeds: Seeds = 1,
    seed: FirstSeed = 0,
    only: Only = "1/1",
    gap: GapLevel = 0.0,
    repair: RepairName = PAPER,
    search: StudySearch = None,
    score: StudyScore = None,
    controller: ControllerKind = "network",
    neurons: Neurons = None,
    comparator: ComparatorName = DEFAULT.name,
    kinds: KindNames = PAPER_KIND_NAMES,
    steps: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=10**6,
            metavar="N",
            help="Control steps of a trial.",
            show_default="1000, an episode of the suite",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    population: Population = 100,
    generations: Generations = 30,
    trials: Trials = 3,
    workers: Workers = 0,
    executor: ExecutorName = PROCESSES,
    executor_option: ExecutorOptions = "",
    table: TableFormat = None,
    as_json: Json = False,
) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds.

    An interrupted study is continued by the same command.
    """
    if table is not None:
        check_format(table)
    domain_names = inputs.texts("--domains", domains, DOMAINS)
    wanted = None if tasks is None else inputs.texts("--tasks", tasks, tasks_of(domain_names))
    chosen = bodies(domain_names, wanted)
    # The last sample of a trial has no reward: an episode of the suite has 1000 rewards.
    length = steps if steps is not None else 1001 if score == "return" else 1000
    study = Study(
        bodies=chosen,
        cases=inputs.whole_numbers("--case", cases, known_cases(chosen)),
        seeds=range(seed, seed + seeds),
        folder=out,
        settings=Settings(steps=length, trials=trials, generations=generations).scaled(population),
        score=score,
        controller=controller,
        comparator=comparator,
        kinds=kind_names(kinds),
        gap=gap,
        neurons=neurons,
        repair=repair,
        search=search,
    )
    share = inputs.share("--only", only)
    planned = cells(study, share)
    if repair != PAPER:
        cost = repair_cost(planned, study.settings, repair, trials, read_study(out))
        if cost.steps:
            print_notes(f"note: {cost}")
    failed = grid_display.run_shown(
        planned, out, executor=executor, options=executor_option, workers=workers
    )
    results = write_results(out)
    found_table = _table(results.summaries)
    tables = write_tables(out, [found_table], table)
    files = [str(path) for path in (*results.files, *tables)]
    if as_json:
        failures = grid_display.as_objects(failed)
        print_json({**results.as_dict(), "failures": failures, "files": files}, indent=1)
    else:
        _print(found_table)
        print_lines(*files)
    grid_display.end(failed)


def _table(summaries: tuple[Summary, ...]) -> Table:
    rows = [_texts(summary) for summary in summaries]
    return table_of_records("summaries", summaries, COLUMNS, rows, texts=3)


def _print(table: Table) -> None:
    if table.rows:
        show(table.columns, table.rows, texts=table.texts)
        print_lines("Medians over the runs; right with its 95 % interval, %.")


def _texts(summary: Summary) -> list[str]:
    share = summary.correct
    return [
        summary.robot,
        "single faults" if summary.case is None else str(summary.case),
        summary.truth,
        f"{summary.right} of {summary.runs} ({100 * share.low:.0f} to {100 * share.high:.0f})",
        *(f"{value:.2f}" for value in (summary.before, summary.after, summary.recovered)),
        "-" if summary.recovery is None else f"{summary.recovery:.2f}",
        f"{summary.upright} of {summary.runs}",
        f"{summary.trials:.0f}",
        f"{summary.seconds:.0f}",
    ]
