"""Progress on standard error: a line per finished search, trial or run, and a bar on a terminal."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
)

from selfmodel.cli.output import counted, plain
from selfmodel.cli.tables import text_console
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
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
def progress_bar(*columns: ProgressColumn) -> Iterator[Progress | None]:
    """Yields a progress bar on standard error; None where that is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    with Progress(*columns, console=text_console(stderr=True), expand=True) as progress:
        yield progress


class Lines:
    """Prints lines above a bar, or alone."""

    def __init__(self, bar: Progress | None) -> None:
        self.bar = bar
        self._console = bar.console if bar else text_console(stderr=True)

    def print_line(self, line: str) -> None:
        """Prints a line."""
        self._console.print(plain(line), soft_wrap=True)


@contextmanager
def display(
    describe: Callable[[Trial], str] = displacement_text,
) -> Iterator[Callable[[Event], None]]:
    """Yields a function that displays the events of a recovery or a diagnosis.

    Args:
        describe: Returns the result of a trial as text.
    """
    best, rate = TextColumn("best {task.fields[best]}"), TextColumn("{task.fields[rate]}/s")
    text = TextColumn("{task.description}")
    with progress_bar(text, BarColumn(bar_width=None), MofNCompleteColumn(), best, rate) as bar:
        yield _Events(bar, describe)


class _Events(Lines):
    def __init__(self, bar: Progress | None, describe: Callable[[Trial], str]) -> None:
        super().__init__(bar)
        self._describe = describe
        self._search = ""
        self._task: TaskID | None = None

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins(kind, hypothesis):
                purpose = "" if hypothesis is None else f" for {hypothesis}"
                self._search = f"{_SEARCHES[kind]}{purpose}"
                if self.bar:
                    # Without the hypothesis, the bar fits a narrow terminal.
                    self._task = self.bar.add_task(_SEARCHES[kind], total=None, best="-", rate="-")
            case Generation():
                self._show(event)
            case ChosenComparator():
                self.print_line(f"comparator {event.comparator.name}: {event.reason}")
            case Calibration():
                for line in _fit_lines(event):
                    self.print_line(line)
            case DiscriminatingTrial():
                apart = ", ".join(map(str, event.hypotheses))
                self.print_line(f"the next trial discriminates between: {apart}")
            case Trial():
                self.print_line(f"trial {event.plan.name}: {self._describe(event)}")
            case Diagnosis():
                best = event.ranked[0]
                finite = math.isfinite(best.distance)
                distance = f"distance {best.distance:.4f}" if finite else "diverged"
                self.print_line(
                    f"diagnosis from {counted(event.trials, 'trial')}: "
                    f"{best.hypothesis} ({distance}), {event.verdict}"
                )

    def _show(self, now: Generation) -> None:
        rate = f"{now.evaluations / now.seconds:.0f}" if now.seconds else "-"
        ends = now.number == now.total
        if self.bar and self._task is not None:
            shown = {"best": f"{now.best:.3f}", "rate": rate}
            self.bar.update(self._task, total=now.total, completed=now.number, **shown)  # type: ignore[arg-type]
            if ends:
                self.bar.remove_task(self._task)
        if ends:
            diverged = now.best == -math.inf
            self.print_line(
                f"{self._search}: {counted(now.number, 'generation')}, "
                f"{counted(now.evaluations, 'evaluation')}, {rate}/s, "
                f"{'every simulation diverged' if diverged else f'best {now.best:.4f}'}"
            )


def _fit_lines(fit: Calibration) -> list[str]:
    """Returns the errors of a calibration, what it did not determine, and what is suspicious."""
    names = fit.undetermined
    every = "all factors" if len(names) == len(fit.rows()) else ", ".join(names)
    unknown = f"; {UNDETERMINED}: {every}" if names else ""
    error = f"calibration: error {fit.error_before:.3f} before, {fit.error:.3f} after; "
    return [
        error + f"delay {counted(fit.parameters.delay, 'step')}{unknown}",
        *(f"calibration: {line}" for line in fit.contacts),
        *([] if fit.suspicion is None else [f"warning: {fit.suspicion}"]),
    ]
