"""Progress of a recovery or a diagnosis: lines for finished work, and a bar on a terminal.

The hypothesis of a search is in the line after the search, not in the bar: the bar's numbers fit a
narrow terminal.
"""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn

from selfmodel.cli.output.console import text_console
from selfmodel.cli.output.plain import counted, plain
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.evolution import Generation
from selfmodel.recovery.result import DiscriminatingTrial, Event, SearchBegins
from selfmodel.simulation.calibration import UNDETERMINED, Calibration
from selfmodel.trials.trial import Trial

_SEARCHES = {"repair": "repair", "diagnostic": "diagnostic EA"}
"""Text of each kind of search."""


def displacement_text(trial: Trial) -> str:
    """Returns the displacement of a trial as text."""
    return f"{trial.displacement:.3f} m forward"


@contextmanager
def display(
    describe: Callable[[Trial], str] = displacement_text,
) -> Iterator[Callable[[Event], None]]:
    """Yields a function that displays events on standard error.

    Args:
        describe: Returns the result of a trial as text.
    """
    console = text_console(stderr=True)
    if not sys.stderr.isatty():
        yield _Lines(console, describe)
        return
    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("best {task.fields[best]}"),
        TextColumn("{task.fields[rate]}/s"),
        console=console,
        expand=True,
    )
    with progress:
        yield _Bar(progress, describe)


class _Lines:
    """Prints a line per finished search, trial, calibration and diagnosis."""

    def __init__(self, console: Console, describe: Callable[[Trial], str]) -> None:
        self._console = console
        self._describe = describe
        self._search = ""

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins(kind, hypothesis):
                purpose = "" if hypothesis is None else f" for {hypothesis}"
                self._search = f"{_SEARCHES[kind]}{purpose}"
            case Generation() if event.number == event.total:
                self._print_line(
                    f"{self._search}: {counted(event.number, 'generation')}, "
                    f"{counted(event.evaluations, 'evaluation')}, {_rate(event)}/s, "
                    f"{_best(event)}"
                )
            case ChosenComparator():
                self._print_line(f"comparator {event.comparator.name}: {event.reason}")
            case Calibration():
                self._print_line(
                    f"calibration: error {event.error_before:.3f} before, {event.error:.3f} after; "
                    f"delay {counted(event.parameters.delay, 'step')}{_undetermined(event)}"
                )
                for line in event.contacts:
                    self._print_line(f"calibration: {line}")
                if event.suspicion is not None:
                    self._print_line(f"warning: {event.suspicion}")
            case DiscriminatingTrial():
                apart = ", ".join(map(str, event.hypotheses))
                self._print_line(f"the next trial discriminates between: {apart}")
            case Trial():
                self._print_line(f"trial {event.plan.name}: {self._describe(event)}")
            case Diagnosis():
                best = event.ranked[0]
                self._print_line(
                    f"diagnosis from {counted(event.trials, 'trial')}: "
                    f"{best.hypothesis} ({_distance(best)}), {event.verdict}"
                )

    def _print_line(self, line: str) -> None:
        self._console.print(plain(line), soft_wrap=True)


class _Bar:
    """Prints the same lines above a bar for the current search."""

    def __init__(self, progress: Progress, describe: Callable[[Trial], str]) -> None:
        self._progress = progress
        self._lines = _Lines(progress.console, describe)
        self._task: TaskID | None = None

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins():
                self._task = self._progress.add_task(
                    _SEARCHES[event.kind], total=None, best="-", rate="-"
                )
            case Generation() if self._task is not None:
                self._progress.update(
                    self._task,
                    total=event.total,
                    completed=event.number,
                    best=f"{event.best:.3f}",
                    rate=_rate(event),
                )
                if event.number == event.total:
                    self._progress.remove_task(self._task)
        self._lines(event)


def _undetermined(fit: Calibration) -> str:
    """Returns the names of the factors that the trials do not determine, after a comma."""
    names = fit.undetermined
    if not names:
        return ""
    every = len(names) == len(fit.rows())
    return f"; {UNDETERMINED}: {'all factors' if every else ', '.join(names)}"


def _best(generation: Generation) -> str:
    """Returns the best fitness as text; every simulation diverged where it is minus infinity."""
    if generation.best == -math.inf:
        return "every simulation diverged"
    return f"best {generation.best:.4f}"


def _distance(candidate: Candidate) -> str:
    finite = math.isfinite(candidate.distance)
    return f"distance {candidate.distance:.4f}" if finite else "diverged"


def _rate(generation: Generation) -> str:
    return f"{generation.evaluations / generation.seconds:.0f}" if generation.seconds else "-"
