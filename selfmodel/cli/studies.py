"""Commands that run studies: ``ablate``, ``suite run`` and ``paper``."""

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import typer

from selfmodel.cli import inputs
from selfmodel.cli.commands import Ablate, RepeatPaper, RunSuite, Study as Options, settings_of
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import grid_display
from selfmodel.cli.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.registry import kind_names
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies import figures, plans, rows as loaded, tables as formats
from selfmodel.studies.comparisons import balance_warnings
from selfmodel.studies.grid import CellEnds, dask_executor
from selfmodel.studies.paper_page import tables_of, write_results
from selfmodel.studies.statistics import Interval
from selfmodel.studies.study import Row, Study
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
        kinds=kind_names(options.kinds),
        comparators=inputs.texts("--comparator", options.comparators, COMPARATORS),
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
    failed = run_shown(study, options)
    rows = loaded.study_rows(study.name, options.out)
    scores = formats.ablation_scores(rows)
    ends = {one["trials"] for one in scores}
    shown = [one for one in scores if one["trials"] in (min(ends), max(ends))]
    drawn = figures.of_ablation(rows, scores)
    notes = balance_warnings(loaded.whole(loaded.outcomes_of(study.name, rows)))
    _finish(
        study,
        failed,
        formats.results_files(study.name, rows, "scores", scores)
        | {f"figures/{name}": data for name, data in drawn.items()},
        [_score_table(scores)],
        {"rows": rows, "scores": scores},
        options=options,
        shown=_score_table(shown),
        legend="With 95 % intervals; time as a multiple of the paper's comparator's.",
        notes=[f"warning: {note}" for note in notes],
    )


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
        kinds=kind_names(options.kinds),
        gap=options.gap,
        neurons=options.neurons,
        repair=options.repair,
        search=options.search,
        only=inputs.share("--only", options.only),
    )
    failed = run_shown(study, options)
    rows = loaded.study_rows(study.name, options.out)
    summaries = formats.suite_summaries(rows)
    found = formats.table_of("summaries", summaries, list(map(_summary_texts, summaries)), texts=3)
    _finish(
        study,
        failed,
        formats.results_files(study.name, rows, "summaries", summaries),
        [found],
        {"rows": rows, "summaries": summaries},
        options=options,
        shown=found,
        legend="Medians over the runs; right with its 95 % interval, %.",
    )


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
    failed = run_shown(study, options)
    results, files = write_results(options.out)
    tables = tables_of(results)
    _finish(
        study,
        failed,
        {},
        tables,
        results.as_dict(),
        options=options,
        shown=tables[1],
        legend="Medians over the runs, m; the paper: whether it reports the case as restored.",
        written=files,
    )


def _finish(
    study: Study,
    failed: Sequence[CellEnds],
    results: Mapping[str, bytes],
    tables: Sequence[formats.Table],
    facts: Mapping[str, Any],
    *,
    options: Options,
    shown: formats.Table,
    legend: str,
    notes: Sequence[str] = (),
    written: Sequence[Path] = (),
) -> None:
    """Writes the results of a study, prints them, and ends the command.

    Args:
        study: The study.
        failed: Its failed cells.
        results: Content of its files by path in its folder.
        tables: Its tables, for the chosen format.
        facts: What ``--json`` prints.
        options: Options of the study.
        shown: The table for readers.
        legend: Line below it.
        notes: Lines on standard error.
        written: Files that were written before.
    """
    paths = [*written, *formats.write_files(study.folder, results)]
    if options.table is not None:
        content = formats.table_files(tables, options.table)
        paths += formats.write_files(study.folder / "tables", content)
    files = [str(path) for path in paths]
    if options.as_json:
        failures = [{"run": one.name, "error": one.error} for one in failed]
        print_json(formats.as_json({**facts, "failures": failures, "files": files}), indent=1)
    else:
        if len(shown.shown):
            show(list(shown.shown.columns), shown.shown.to_numpy().tolist(), texts=shown.texts)
            print_lines(legend)
        print_notes(*notes)
        print_lines(*files)
    if failed:
        print_notes(
            f"{len(failed)} failed, the first of them {failed[0].name}: {failed[0].error}; the "
            f"same command tries them again"
        )
        raise typer.Exit(1)


def _score_table(scores: Sequence[Row]) -> formats.Table:
    has_recovery = any(one["recovery"] for one in scores)
    texts = [
        {
            "robot": one["robot"],
            "gap": f"{one['gap']:g}",
            "comparator": one["comparator"],
            "trials": str(one["trials"]),
            "right": f"{one['right']} of {one['runs']}",
            "right, %": _interval(one["correct"], 100, ".0f"),
            "time": _interval(one["time"]),
            **({"recovered ÷ before": _interval(one["recovery"])} if has_recovery else {}),
        }
        for one in scores
    ]
    return formats.table_of("scores", scores, texts, texts=3)


def _summary_texts(one: Row) -> dict[str, str]:
    share = one["correct"]
    ends = f"({100 * share.low:.0f} to {100 * share.high:.0f})"
    return {
        "robot": one["robot"],
        "case": "single faults" if one["case"] is None else str(one["case"]),
        "truth": one["truth"],
        "right": f"{one['right']} of {one['runs']} {ends}",
        **{name: f"{one[name]:.2f}" for name in ("before", "after", "recovered")},
        "recovered ÷ before": "-" if one["recovery"] is None else f"{one['recovery']:.2f}",
        "upright": f"{one['upright']} of {one['runs']}",
        **{name: f"{one[name]:.0f}" for name in ("trials", "seconds")},
    }


def _interval(interval: Interval | None, factor: float = 1, form: str = ".2f") -> str:
    if interval is None:
        return "-"
    estimate, low, high = (
        format(factor * one, form) for one in (interval.estimate, interval.low, interval.high)
    )
    known = not math.isnan(interval.low + interval.high)
    return f"{estimate} ({low} to {high})" if known else estimate


def run_shown(study: Study, options: Options) -> Sequence[CellEnds]:
    """Computes the cells of a study with a progress display; returns the failed ones.

    Ctrl-C and the other stop signals end the command with a line on how to continue.

    Raises:
        InputError: The executor is unknown, the scheduler is missing or does not answer, or the
            folder contains another study.
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
