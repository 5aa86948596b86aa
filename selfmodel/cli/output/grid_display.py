"""Progress and end of a command that runs a grid: a bar on a terminal, lines elsewhere."""

import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from time import monotonic

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from selfmodel.cli.commands import Study as StudyOptions
from selfmodel.cli.output.console import text_console
from selfmodel.cli.output.plain import plain
from selfmodel.cli.output.printing import print_notes
from selfmodel.errors import InputError, unknown_name
from selfmodel.simulation.simulator import thread_count
from selfmodel.studies.grid import CellEnds, GridBegins, dask_executor
from selfmodel.studies.study import Study

PROCESSES, DASK = EXECUTORS = ("processes", "dask")
"""What may compute the cells: processes of this machine, or the workers of a Dask cluster."""


class Watch:
    """Displays the events of a grid and counts its cells.

    Args:
        console: Console of the lines.
        progress: Progress bar, if any: then only failures are lines.

    Attributes:
        done: Cells that are done or have failed.
        total: All cells.
    """

    def __init__(self, console: Console, progress: Progress | None) -> None:
        self.done = self.total = 0
        self._console = console
        self._progress = progress
        self._before, self._start = 0, monotonic()

    def __call__(self, event: GridBegins | CellEnds) -> None:
        """Displays an event."""
        match event:
            case GridBegins():
                self.done, self.total = event.finished, event.total
                self._before, self._start = event.finished, monotonic()
                if self._progress:
                    self._progress.add_task("", total=event.total, completed=event.finished)
                elif event.finished:
                    self._print_line(f"{event.finished} of {event.total} were done before")
            case CellEnds():
                self.done = event.number
                seconds = monotonic() - self._start
                speed = pace(event.number - self._before, event.total - event.number, seconds)
                if self._progress:
                    task = self._progress.task_ids[0]
                    self._progress.update(task, completed=event.number, description=speed)
                if event.error is not None or not self._progress:
                    self._print_line("; ".join(filter(None, (_line(event), speed))))

    def _print_line(self, line: str) -> None:
        self._console.print(plain(line), soft_wrap=True)


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


@contextmanager
def grid_display() -> Iterator[Watch]:
    """Yields a display of grid events on standard error."""
    console = text_console(stderr=True)
    if not sys.stderr.isatty():
        yield Watch(console, None)
        return
    progress = Progress(
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=console,
        expand=True,
    )
    with progress:
        yield Watch(progress.console, progress)


def _line(event: CellEnds) -> str:
    what = f"failed: {event.error}" if event.error else f"done in {event.seconds:.1f} s"
    return f"[{event.number}/{event.total}] {event.name}: {what}"


def run_shown(study: Study, options: StudyOptions) -> Sequence[CellEnds]:
    """Computes the cells of a study with a progress display; returns the failed ones.

    Ctrl-C and the other stop signals end the command with a line on how to continue.

    Args:
        study: The study.
        options: Options of the study.

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
    with opened as given, grid_display() as on_event:
        try:
            workers = thread_count(options.workers)
            return study.run(executor=given, workers=workers, on_progress=on_event)
        except KeyboardInterrupt as interruption:
            interruption.add_note(
                f"{on_event.done} of {on_event.total} are done and kept in {study.folder}; the "
                f"same command continues with the rest"
            )
            raise


def as_objects(failed: Sequence[CellEnds]) -> list[dict[str, str | None]]:
    """Returns failed cells as JSON values."""
    return [{"run": one.name, "error": one.error} for one in failed]


def end(failed: Sequence[CellEnds]) -> None:
    """Ends the command with status 1 and a line if a cell failed."""
    if failed:
        print_notes(
            f"{len(failed)} failed, the first of them {failed[0].name}: {failed[0].error}; the "
            f"same command tries them again"
        )
        raise typer.Exit(1)
