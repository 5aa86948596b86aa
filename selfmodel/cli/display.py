"""What ``selfmodel recover`` shows while it works: bars on a terminal, plain lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.table import Column

from selfmodel.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.recover import Event, SearchBegins
from selfmodel.trial import Trial


@contextmanager
def display() -> Iterator[Callable[[Event], None]]:
    """Gives a function that shows the events it is told of, on standard error."""
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield _Lines(console)
        return
    progress = Progress(
        # A long hypothesis gives way to the bar and the numbers, not they to it.
        TextColumn(
            "{task.description}",
            table_column=Column(ratio=3, no_wrap=True, overflow="ellipsis"),
        ),
        BarColumn(bar_width=None, table_column=Column(ratio=1)),
        MofNCompleteColumn(),
        TextColumn("best {task.fields[best]}"),
        TextColumn("{task.fields[rate]}/s"),
        console=console,
        expand=True,
    )
    with progress:
        yield _Bars(progress)


class _Lines:
    """A line for the end of each search, for every trial and every diagnosis."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._search = ""

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins():
                self._search = _title(event)
            case Generation() if event.number == event.total:
                self._say(
                    f"{self._search}: {event.number} generations, {event.evaluations} "
                    f"evaluations, {_rate(event)}/s, best {event.best:.4f}"
                )
            case Trial() | Diagnosis():
                self._say(_sentence(event))

    def _say(self, line: str) -> None:
        self._console.print(line, soft_wrap=True)


class _Bars:
    """A bar for each search, with generation, best fitness and evaluations per second."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task: TaskID | None = None

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins():
                self._task = self._progress.add_task(_title(event), total=None, best="-", rate="-")
            case Generation() if self._task is not None:
                self._progress.update(
                    self._task,
                    total=event.total,
                    completed=event.number,
                    best=f"{event.best:.3f}",
                    rate=_rate(event),
                )
            case Trial() | Diagnosis():
                self._progress.console.print(_sentence(event))


def _title(search: SearchBegins) -> str:
    return f"{search.kind} EA" + ("" if search.hypothesis is None else f" for {search.hypothesis}")


def _rate(generation: Generation) -> str:
    return f"{generation.evaluations / generation.seconds:.0f}" if generation.seconds else "-"


def _sentence(event: Trial | Diagnosis) -> str:
    if isinstance(event, Trial):
        return f"trial {event.plan.name}: {event.displacement:.3f} m forward"
    best = event.ranked[0]
    trials = "1 trial" if event.trials == 1 else f"{event.trials} trials"
    return f"diagnosis from {trials}: {best.hypothesis} (distance {best.distance:.4f})"
