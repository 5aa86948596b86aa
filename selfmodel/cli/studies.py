"""Commands that run studies: ``ablate``, ``suite run`` and ``paper``."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

import typer

from selfmodel.cli import inputs
from selfmodel.cli.commands import Ablate, RepeatPaper, RunSuite, Study as Options, settings_of
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import grid_display
from selfmodel.cli.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError, unknown_name
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies import paper_page, plans, tables as formats
from selfmodel.studies.grid import CellEnds, dask_executor
from selfmodel.studies.study import Study
from selfmodel.tasks import ROBOTS

PROCESSES, DASK = EXECUTORS = ("processes", "dask")
"""What may compute the cells of a study: processes of this machine, or a Dask cluster's workers."""


def ablate(options: Ablate) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds."""
    formats.check_format(options.table)
    cases = options.cases.strip()
    numbers = () if cases in ("all", "none") else inputs.whole_numbers("--case", cases, ())
    study = plans.ablation(
        options.out,
        robots=inputs.texts("--robots", options.robots, ROBOTS),
        cases=None if cases == "all" else numbers,
        damages=[damage.strip() for damage in options.damages.split(",") if damage.strip()],
        kinds=options.kinds,
        comparators=inputs.texts("--comparator", options.comparators, COMPARATORS),
        diagnostic_searches=options.diagnostic_search.split(","),
        gaps=inputs.numbers("--gap", options.gaps),
        seeds=options.every_seed,
        settings=options.settings,
        next_trial=options.next_trial,
        bank=options.bank,
        score=options.score,
        repair=options.repair,
        search=options.search,
        only=inputs.share("--only", options.only),
    )
    _run(study, options, formats.ablation_results)


def run_suite(options: RunSuite) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds."""
    formats.check_format(options.table)
    names = inputs.texts("--domains", options.domains, plans.DOMAINS)
    wanted = (
        None
        if options.tasks is None
        else inputs.texts("--tasks", options.tasks, plans.tasks_of(names))
    )
    bodies = plans.bodies_of(names, wanted)
    # The last sample of a trial has no reward: an episode of the suite has 1000 rewards.
    length = options.steps or (1001 if options.score == "return" else Settings.steps)
    study = plans.suite(
        options.out,
        bodies=bodies,
        cases=inputs.whole_numbers("--case", options.cases, plans.known_cases(bodies)),
        seeds=options.every_seed,
        settings=settings_of(options, length),
        score=options.score,
        controller=options.controller,
        comparator=options.comparator,
        kinds=options.kinds,
        gap=options.gap,
        neurons=options.neurons,
        repair=options.repair,
        search=options.search,
        only=inputs.share("--only", options.only),
    )
    _run(study, options, formats.suite_results)


def paper(options: RepeatPaper) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown."""
    formats.check_format(options.table)
    study = plans.paper(
        options.out,
        robots=inputs.texts("--robots", options.robots, ROBOTS),
        cases=inputs.whole_numbers("--case", options.cases, plans.TABLE_ONE),
        seeds=options.every_seed,
        comparators=inputs.texts("--comparator", options.comparators, COMPARATORS),
        settings=options.settings,
    )
    _run(study, options, paper_page.results_of)


def _run(study: Study, options: Options, results_of: Callable[[Path], formats.Results]) -> None:
    """Runs a study, writes and prints its results, and ends the command."""
    failed = _compute(study, options)
    found = results_of(study.folder)
    files = dict(found.files)
    if options.table is not None:
        content = formats.table_files(found.tables, options.table)
        files |= {f"tables/{name}": data for name, data in content.items()}
    paths = [str(path) for path in formats.write_files(study.folder, files)]
    if options.as_json:
        failures = [{"run": one.name, "error": one.error} for one in failed]
        facts = to_json({**found.facts, "failures": failures, "files": paths})
        print_json(facts, indent=1)
    else:
        if len(rows := found.shown.shown):
            show(list(rows.columns), rows.to_numpy().tolist(), texts=found.shown.texts)
            print_lines(found.legend)
        print_notes(*found.notes)
        print_lines(*paths)
    if failed:
        print_notes(
            f"{len(failed)} failed, the first of them {failed[0].name}: {failed[0].error}; the "
            f"same command tries them again"
        )
        raise typer.Exit(1)


def _compute(study: Study, options: Options) -> Sequence[CellEnds]:
    """Computes the cells of a study with a progress display; returns the failed ones.

    Ctrl-C and the other stop signals end the command with a line on how to continue.
    """
    executor, scheduler = options.executor, options.scheduler
    if executor not in EXECUTORS:
        raise unknown_name("executor", executor, EXECUTORS)
    if (scheduler is None) == (executor == DASK):
        raise InputError(
            f"expected --scheduler ADDRESS with --executor {DASK}, and with no other: give both, "
            f"such as --executor {DASK} --scheduler 192.0.2.1:8786"
        )
    opened = nullcontext() if scheduler is None else dask_executor(scheduler)
    workers = thread_count(options.workers)
    with opened as given, grid_display() as shown:
        try:
            return study.run(executor=given, workers=workers, on_progress=shown)
        except KeyboardInterrupt as interruption:
            interruption.add_note(
                f"{shown.done} of {shown.total} are done and kept in {study.folder}; the same "
                f"command continues with the rest"
            )
            raise
