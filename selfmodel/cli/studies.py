"""Commands that run and compare studies: ``ablate``, ``suite``, ``paper`` and ``compare``."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from itertools import groupby
from pathlib import Path
from time import monotonic
from typing import Any

import pandas as pd
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from selfmodel.arguments import robot_entry
from selfmodel.cli import inputs
from selfmodel.cli.commands import (
    Ablate,
    ListSuite,
    RepeatPaper,
    RunSuite,
    Study as StudyOptions,
    settings_of,
)
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import Lines, progress_bar
from selfmodel.cli.tables import show
from selfmodel.comparators import COMPARATORS
from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.registry import kind_names
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies import figures, plans
from selfmodel.studies.comparisons import balance_warnings
from selfmodel.studies.grid import CellEnds, GridBegins, dask_executor
from selfmodel.studies.paper_page import tables_of, write_results
from selfmodel.studies.rows import outcomes_of, study_rows, whole
from selfmodel.studies.statistics import Interval
from selfmodel.studies.study import Row, Study
from selfmodel.studies.tables import (
    Table,
    ablation_scores,
    as_json as json_of,
    check_format,
    results_files,
    suite_summaries,
    table_files,
    table_of,
    write_files,
)
from selfmodel.tasks import ROBOTS

PROCESSES, DASK = EXECUTORS = ("processes", "dask")
"""What may compute the cells of a study: processes of this machine, or a Dask cluster's workers."""


def ablate(options: Ablate) -> None:
    """Compare comparators on the same trials: robots x cases x gaps x seeds."""
    cases = options.cases
    check_format(options.table)
    cases = cases.strip()
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
    rows = study_rows(study.name, options.out)
    scores = ablation_scores(rows)
    ends = {one["trials"] for one in scores}
    shown = [one for one in scores if one["trials"] in (min(ends), max(ends))]
    notes = balance_warnings(whole(outcomes_of(study.name, rows)))
    _finish(
        study,
        failed,
        results_files(study.name, rows, "scores", scores) | figures_of(rows, scores),
        [_score_table(scores)],
        {"rows": rows, "scores": scores},
        options=options,
        shown=_score_table(shown),
        legend="With 95 % intervals; time as a multiple of the paper's comparator's.",
        notes=[f"warning: {note}" for note in notes],
    )


def figures_of(rows: Sequence[Row], scores: Sequence[Row]) -> dict[str, bytes]:
    """Returns the files of the figures of an ablation, in their folder."""
    found = figures.of_ablation(rows, scores)
    return {f"figures/{name}": data for name, data in found.items()}


def run_suite(options: RunSuite) -> None:
    """Fail and recover bodies of the suite, selfmodel's and your own: bodies x cases x seeds."""
    check_format(options.table)
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
    rows = study_rows(study.name, options.out)
    summaries = suite_summaries(rows)
    found = table_of("summaries", summaries, list(map(_summary_texts, summaries)), texts=3)
    _finish(
        study,
        failed,
        results_files(study.name, rows, "summaries", summaries),
        [found],
        {"rows": rows, "summaries": summaries},
        options=options,
        shown=found,
        legend="Medians over the runs; right with its 95 % interval, %.",
    )


def list_bodies(options: ListSuite) -> None:
    """List the domains with their tasks, cases, joints, sensors, motors and time steps."""
    found = [_domain_facts(domain) for domain in plans.DOMAINS]
    if options.as_json:
        print_json({"domains": found})
        return
    columns = ("domain", "tasks", "cases", "joints", "sensors", "motors", "weights", "step, s")
    rows = [
        [
            one["domain"],
            ", ".join(one["tasks"]),
            _ranges([int(number) for number in one["cases"]]),
            *(str(one[key]) for key in ("joints", "sensors", "motors", "weights")),
            f"{one['physics_timestep']:g} x {one['substeps']}",
        ]
        for one in found
    ]
    show(columns, rows, texts=3)
    print_lines(
        "Robots of the suite are called DOMAIN-TASK: `selfmodel robots NAME` lists the parts."
    )


def paper(options: RepeatPaper) -> None:
    """Repeat the paper's experiment: its tables and figures, as PNG, PDF, CSV and Markdown."""
    check_format(options.table)
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
    failed: Sequence[Any],
    results: Mapping[str, bytes],
    tables: Sequence[Table],
    facts: Mapping[str, Any],
    *,
    options: StudyOptions,
    shown: Table,
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
    paths = [*written, *write_files(study.folder, results)]
    if options.table is not None:
        paths += write_files(study.folder / "tables", table_files(tables, options.table))
    files = [str(path) for path in paths]
    if options.as_json:
        failures = [{"run": one.name, "error": one.error} for one in failed]
        print_json(json_of({**facts, "failures": failures, "files": files}), indent=1)
    else:
        if len(shown.shown):
            _show(shown.shown, shown.texts)
            print_lines(legend)
        print_notes(*notes)
        print_lines(*files)
    end(failed)


def _show(frame: pd.DataFrame, texts: int) -> None:
    show(list(frame.columns), frame.to_numpy().tolist(), texts=texts)


def _score_table(scores: Sequence[Row]) -> Table:
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
    return table_of("scores", scores, texts, texts=3)


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


def _domain_facts(domain: str) -> dict[str, Any]:
    entry = robot_entry(plans.bodies_of([domain], None)[0])
    robot = entry.robot()
    return {
        "domain": domain,
        "tasks": list(plans.DOMAINS[domain]),
        "robots": list(plans.bodies_of([domain], plans.DOMAINS[domain])),
        "joints": len(robot.anatomy.joints),
        "hinges": len(robot.anatomy.hinges),
        "sensors": len(robot.anatomy.sensors),
        "motors": len(robot.anatomy.motors),
        "weights": network_for(robot).weights,
        "physics_timestep": float(robot.model.opt.timestep),
        "substeps": robot.substeps,
        "control_timestep": robot.control_timestep,
        "cases": {str(number): notation for number, notation in entry.cases.items()},
    }


def _ranges(numbers: list[int]) -> str:
    """Returns ascending numbers as text, with three or more consecutive ones as ``1 to 3``."""
    runs = groupby(enumerate(numbers), key=lambda item: item[1] - item[0])
    found = [[number for _, number in run] for _, run in runs]
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in found
    )


def _interval(interval: Interval | None, factor: float = 1, form: str = ".2f") -> str:
    if interval is None:
        return "-"
    estimate, low, high = (
        format(factor * one, form) for one in (interval.estimate, interval.low, interval.high)
    )
    known = not math.isnan(interval.low + interval.high)
    return f"{estimate} ({low} to {high})" if known else estimate


def run_shown(study: Study, options: StudyOptions) -> Sequence[CellEnds]:
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


@contextmanager
def grid_display() -> Iterator["GridDisplay"]:
    """Yields a display of grid events on standard error."""
    speed = TextColumn("{task.description}")
    bar = BarColumn(bar_width=None)
    with progress_bar(bar, MofNCompleteColumn(), TimeElapsedColumn(), speed) as progress:
        yield GridDisplay(progress)


class GridDisplay(Lines):
    """Displays the events of a grid: above a bar, only failures are lines.

    Attributes:
        done: Cells that are done or have failed.
        total: All cells.
    """

    def __init__(self, bar: Progress | None) -> None:
        super().__init__(bar)
        self.done = self.total = 0
        self._before, self._start = 0, monotonic()

    def __call__(self, event: GridBegins | CellEnds) -> None:
        """Displays an event."""
        match event:
            case GridBegins():
                self.done, self.total = event.finished, event.total
                self._before, self._start = event.finished, monotonic()
                if self.bar:
                    self.bar.add_task("", total=event.total, completed=event.finished)
                elif event.finished:
                    self.print_line(f"{event.finished} of {event.total} were done before")
            case CellEnds():
                self.done = event.number
                seconds = monotonic() - self._start
                speed = pace(event.number - self._before, event.total - event.number, seconds)
                if self.bar:
                    task = self.bar.task_ids[0]
                    self.bar.update(task, completed=event.number, description=speed)
                if event.error is not None or not self.bar:
                    end = (
                        f"failed: {event.error}"
                        if event.error
                        else f"done in {event.seconds:.1f} s"
                    )
                    line = f"[{event.number}/{event.total}] {event.name}: {end}"
                    self.print_line("; ".join(filter(None, (line, speed))))


def pace(done: int, left: int, seconds: float) -> str:
    """Returns the rate of cells and the time left as text; nothing at the end.

    Args:
        done: Cells that ended since the start.
        left: Cells that have not ended.
        seconds: Time since the start, s.

    Examples:
        >>> pace(10, 35, 600.0)
        '60 an hour, 0 h 35 min left'
    """
    if not (done and left and seconds > 0):
        return ""
    rate = done / seconds
    minutes = math.ceil(left / rate / 60)
    return f"{3600 * rate:.0f} an hour, {minutes // 60} h {minutes % 60:02d} min left"


def end(failed: Sequence[CellEnds]) -> None:
    """Ends the command with status 1 and a line if a cell failed."""
    if failed:
        print_notes(
            f"{len(failed)} failed, the first of them {failed[0].name}: {failed[0].error}; the "
            f"same command tries them again"
        )
        raise typer.Exit(1)
