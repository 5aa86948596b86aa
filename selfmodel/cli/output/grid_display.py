"""Progress and end of a command that runs a grid: a bar on a terminal, lines elsewhere."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from selfmodel.cli.output.console import text_console
from selfmodel.cli.output.plain import counted, plain
from selfmodel.cli.output.printing import print_notes
from selfmodel.experiments.grid import GridBegins, PartEnds


class Watch:
    """Displays the events of grids and counts the parts of the current one.

    Args:
        console: Console of the lines.
        progress: Progress bar, if any: then only failures are lines.

    Attributes:
        done: Parts of the current grid that are done or have failed.
        total: Parts of the current grid.
    """

    def __init__(self, console: Console, progress: Progress | None) -> None:
        self.done = self.total = 0
        self._console = console
        self._progress = progress
        self._task: TaskID | None = None

    def __call__(self, event: GridBegins | PartEnds) -> None:
        """Displays an event."""
        match event:
            case GridBegins():
                self.done, self.total = event.finished, event.total
                if self._progress:
                    if self._task is not None:
                        self._progress.remove_task(self._task)
                    self._task = self._progress.add_task(
                        "", total=event.total, completed=event.finished
                    )
                elif event.finished:
                    self._print_line(f"{event.finished} of {event.total} were done before")
            case PartEnds():
                self.done = event.number
                if self._progress and self._task is not None:
                    self._progress.update(self._task, completed=event.number)
                if event.error is not None or not self._progress:
                    self._print_line(_line(event))

    def _print_line(self, line: str) -> None:
        self._console.print(plain(line), soft_wrap=True)


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
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        expand=True,
    )
    with progress:
        yield Watch(progress.console, progress)


def _line(event: PartEnds) -> str:
    what = f"failed: {event.error}" if event.error else f"done in {event.seconds:.1f} s"
    return f"[{event.number}/{event.total}] {event.key} {event.part}: {what}"


def run_shown(run: Callable[[Watch], Sequence[PartEnds]], out: Path) -> Sequence[PartEnds]:
    """Runs a grid with a progress display; returns the failed parts.

    Ctrl-C and the other stop signals end the command with a line on how to continue.

    Args:
        run: Runs the grid; calls its argument with each event.
        out: Folder of the grid.
    """
    with grid_display() as on_event:
        try:
            return run(on_event)
        except KeyboardInterrupt as interruption:
            interruption.add_note(
                f"{on_event.done} of {on_event.total} are done and kept in {out}; the same command "
                f"continues with the rest"
            )
            raise


def note_unverified(count: int, out: Path) -> None:
    """Prints a line if a table has parts without digests.

    Args:
        count: Number of the parts.
        out: Folder of the grid.
    """
    if count:
        print_notes(
            f"note: version 0.1 wrote {counted(count, 'part')} in {out}, without digests: their "
            f"content was not verified"
        )


def as_objects(failed: Sequence[PartEnds]) -> list[dict[str, str | None]]:
    """Returns failed parts as JSON values."""
    return [{"run": one.key, "part": one.part, "error": one.error} for one in failed]


def end(failed: Sequence[PartEnds]) -> None:
    """Ends the command with status 1 and a line if a part failed."""
    if failed:
        print_notes(
            f"{len(failed)} failed, the first of them {failed[0].key} {failed[0].part}: "
            f"{failed[0].error}; the same command tries them again"
        )
        raise typer.Exit(1)
