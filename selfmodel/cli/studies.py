"""Commands that run studies: ``ablate``, ``suite run``, ``paper`` and ``study``."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

import typer

from selfmodel.cli import inputs
from selfmodel.cli.commands import (
    Ablate,
    Computed,
    RepeatPaper,
    RunStudy,
    RunSuite,
    repair_settings_of,
    settings_of,
)
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import grid_display
from selfmodel.cli.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError, check_name
from selfmodel.faults.registry import TABLE_ONE
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies import bodies, paper_page, plans, tables as formats
from selfmodel.studies.definition import read_study
from selfmodel.studies.grid import CellEnds, dask_executor, failures_text
from selfmodel.studies.study import Study
from selfmodel.style import figure_style, read_style
from selfmodel.tasks import ROBOTS

RESULTS: Mapping[str, Callable[[Path], formats.Results]] = {
    "ablate": formats.ablation_results,
    "suite": formats.suite_results,
    "paper": paper_page.results_of,
}
"""Functions of the folder of a study to its results, by the name of the study."""

PROCESSES, DASK = EXECUTORS = ("processes", "dask")
"""What may compute the cells of a study: processes of this machine, or a Dask cluster's workers."""


def ablate(options: Ablate) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds."""
    is_every = options.cases.strip() == "all"
    study = plans.ablation(
        options.out,
        robots=inputs.texts("--robots", options.robots, ROBOTS),
        cases=None if is_every else _cases(options, ()),
        damages=_damages(options),
        kinds=options.kinds,
        comparators=inputs.texts("--comparator", options.comparators, COMPARATORS),
        diagnostic_searches=[one.strip() for one in options.diagnostic_search.split(",")],
        gaps=inputs.numbers("--gap", options.gaps),
        seeds=options.every_seed,
        settings=options.settings,
        repair_settings=repair_settings_of(options, options.settings),
        next_trial=options.next_trial,
        bank=options.bank,
        score=options.score,
        repair=options.repair,
        search=options.search,
        only=options.only,
    )
    _run(study, options)


def run_suite(options: RunSuite) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds."""
    names = inputs.texts("--domains", options.domains, bodies.DOMAINS)
    wanted = (
        None
        if options.tasks is None
        else inputs.texts("--tasks", options.tasks, bodies.tasks_of(names))
    )
    chosen = bodies.bodies_of(names, wanted)
    settings = settings_of(options, options.score)
    study = plans.suite(
        options.out,
        bodies=chosen,
        cases=_cases(options, bodies.known_cases(chosen)),
        damages=_damages(options),
        seeds=options.every_seed,
        settings=settings,
        repair_settings=repair_settings_of(options, settings),
        score=options.score,
        controller=options.controller,
        comparator=options.comparator,
        kinds=options.kinds,
        gap=options.gap,
        neurons=options.neurons,
        repair=options.repair,
        search=options.search,
        only=options.only,
    )
    _run(study, options)


def paper(options: RepeatPaper) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown."""
    study = plans.paper(
        options.out,
        robots=inputs.texts("--robots", options.robots, ROBOTS),
        cases=inputs.whole_numbers("--case", options.cases, TABLE_ONE),
        seeds=options.every_seed,
        comparators=inputs.texts("--comparator", options.comparators, COMPARATORS),
        settings=options.settings,
    )
    _run(study, options)


def run_file(options: RunStudy) -> None:
    """Run the study that a TOML file defines: an ablation, recoveries of bodies, or the paper's."""
    formats.check_format(options.table)
    _run(read_study(options.file), options)


def _cases(options: Ablate | RunSuite, every: Sequence[int]) -> tuple[int, ...]:
    is_none = options.cases.strip() == "none"
    return () if is_none else inputs.whole_numbers("--case", options.cases, every)


def _damages(options: Ablate | RunSuite) -> list[str]:
    return [damage.strip() for damage in options.damages.split(",") if damage.strip()]


def _run(study: Study, options: Computed) -> None:
    formats.check_format(options.table)
    read_style(options.style)
    failed = _compute(study, options)
    with figure_style(options.style):
        found = RESULTS[study.name](study.folder)
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
        print_lines(*found.legend.splitlines())
        print_notes(*found.notes)
        print_lines(*paths)
    if failed:
        print_notes(failures_text(failed, "the same command"))
        raise typer.Exit(1)


def _compute(study: Study, options: Computed) -> Sequence[CellEnds]:
    """Computes the cells of a study with a progress display; returns the failed ones.

    Ctrl-C and the other stop signals end the command with a line on how to continue.
    """
    executor, scheduler = options.executor, options.scheduler
    check_name("executor", executor, EXECUTORS)
    if (scheduler is None) == (executor == DASK):
        raise InputError(
            f"expected --scheduler ADDRESS with --executor {DASK}, and with no other: give both, "
            f"such as --executor {DASK} --scheduler 192.0.2.1:8786"
        )
    opened = nullcontext() if scheduler is None else dask_executor(scheduler)
    workers = thread_count(options.workers)
    with opened as given, grid_display() as shown:
        try:
            return study.run(executor=given, workers=workers, on_event=shown, warns=False)
        except KeyboardInterrupt as interruption:
            interruption.add_note(
                f"{shown.done} of {shown.total} are done and kept in {study.folder}; the same "
                f"command continues with the rest"
            )
            raise
