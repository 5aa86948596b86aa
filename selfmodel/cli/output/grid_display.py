"""What a command shows while it runs a grid: a bar on a terminal, a line a part elsewhere."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

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

from selfmodel.experiments.grid import GridBegins, PartEnds


class Watch:
    """Shows the events of grids, and remembers how far the last one has come.

    Args:
        console: Where lines go.
        progress: The bar, if there is one: then only failures are lines.

    Attributes:
        done: Parts that are done, or have failed, in the grid that goes on.
        total: All its parts.
    """

    def __init__(self, console: Console, progress: Progress | None) -> None:
        self.done = self.total = 0
        self._console = console
        self._progress = progress
        self._task: TaskID | None = None

    def __call__(self, event: GridBegins | PartEnds) -> None:
        """Shows an event."""
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
                    self._say(f"{event.finished} of {event.total} were done before")
            case PartEnds():
                self.done = event.number
                if self._progress and self._task is not None:
                    self._progress.update(self._task, completed=event.number)
                if event.error is not None or not self._progress:
                    self._say(_line(event))

    def _say(self, line: str) -> None:
        self._console.print(line, soft_wrap=True)


@contextmanager
def grid_display() -> Iterator[Watch]:
    """Gives what shows the events of grids, on standard error."""
    console = Console(stderr=True, highlight=False, markup=False, emoji=False)
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
