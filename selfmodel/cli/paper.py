"""``selfmodel paper``: the paper's experiment, as tables and figures beside what it reports."""

from typing import Annotated

import typer

from selfmodel.cli import inputs
from selfmodel.cli.options import (
    STUDY,
    Cases,
    ComparatorNames,
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
from selfmodel.cli.output import grid_display
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.experiments.paper.plan import COMPARATORS as PAPER_COMPARATORS, PaperStudy
from selfmodel.experiments.paper.reported import FAILURES
from selfmodel.experiments.paper.results import PaperResults, write_results
from selfmodel.experiments.paper.tables import CaseSummary
from selfmodel.experiments.paper.work import run_paper
from selfmodel.settings import Settings
from selfmodel.simulation.threads import thread_count
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
    as_json: Json = False,
) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown.

    Each case is recovered with each comparator, and by evolution on the robot, the paper's
    control. An interrupted experiment is continued by the same command.
    """
    study = PaperStudy(
        folder=out,
        robots=inputs.texts("--robots", robots, ROBOTS),
        cases=inputs.whole_numbers("--case", cases, FAILURES),
        seeds=range(seed, seed + seeds),
        comparators=inputs.texts("--comparator", comparators, COMPARATORS),
        settings=Settings(steps=steps, trials=trials, generations=generations).scaled(population),
    )
    failed = grid_display.run_shown(
        lambda on_progress: run_paper(
            study, workers=thread_count(workers), on_progress=on_progress
        ),
        out,
    )
    results = write_results(out)
    if as_json:
        print_json({**results.as_dict(), "failures": grid_display.as_objects(failed)}, indent=1)
    else:
        _print(results)
    grid_display.end(failed)


def _print(results: PaperResults) -> None:
    if results.summaries:
        show(COLUMNS, [_texts(summary) for summary in results.summaries], texts=4)
        print_lines("Medians over the runs, m; the paper: whether it reports the case as restored.")
    print_lines(*map(str, results.files))


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
