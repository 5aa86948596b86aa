"""Progress on standard error: a bar on a terminal, and lines of what is finished."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import rich.progress as bars

from selfmodel.cli.output import plain
from selfmodel.cli.tables import text_console
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import counted
from selfmodel.evolution import Generation
from selfmodel.progress import Progress
from selfmodel.recovery.falls import fall_text
from selfmodel.recovery.result import DiscriminatingTrial, Event, SearchBegins, TrialScore
from selfmodel.recovery.scores import DISPLACEMENT, value_text
from selfmodel.simulation.calibration import UNDETERMINED, Calibration
from selfmodel.studies.grid import CellEnds, GridBegins
from selfmodel.trials.trial import Trial

_SEARCHES = {"repair": "repair", "diagnostic": "diagnostic EA"}
"""Text of each kind of search."""

QUIET = 10.0
"""Time between two lines of the progress of a stage where standard error is no terminal, s."""


class Display:
    """Prints lines above a progress bar, or alone where standard error is no terminal."""

    def __init__(self, bar: bars.Progress | None) -> None:
        self.bar = bar
        self._console = bar.console if bar else text_console(stderr=True)

    def print_lines(self, *lines: str) -> None:
        """Prints lines."""
        for line in lines:
            self._console.print(plain(line), soft_wrap=True)


@contextmanager
def _bar(*columns: bars.ProgressColumn, transient: bool = False) -> Iterator[bars.Progress | None]:
    """Yields a progress bar on standard error; None where that is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    console = text_console(stderr=True)
    with bars.Progress(*columns, console=console, transient=transient, expand=True) as progress:
        yield progress


@contextmanager
def display() -> Iterator[Callable[[Event], None]]:
    """Yields a function that displays the events of a recovery or a diagnosis."""
    names = ("{task.description}", "{task.percentage:.0f} %", "{task.fields[detail]}")
    text, share, detail = map(bars.TextColumn, names)
    with _bar(text, bars.BarColumn(bar_width=None), share, detail, transient=True) as bar:
        yield _Events(bar)


class _Events(Display):
    def __init__(self, bar: bars.Progress | None) -> None:
        super().__init__(bar)
        self._search = self._kind = self._stage = ""
        self._start = self._told = monotonic()

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins(kind, hypothesis):
                purpose = "" if hypothesis is None else f" for {hypothesis}"
                # Without the hypothesis, the bar fits a narrow terminal.
                self._kind, self._search = _SEARCHES[kind], f"{_SEARCHES[kind]}{purpose}"
                self._show(Progress(self._kind, 0, 1))
            case Generation():
                best = f"best {event.best:.3f}, {_rate(event)}/s"
                self._show(Progress(self._kind, event.number, event.total), best)
                if event.number == event.total:
                    self.print_lines(f"{self._search}: {_end(event)}")
            case Progress():
                self._show(event)
            case ChosenComparator():
                self.print_lines(f"comparator {event.comparator.name}: {event.reason}")
            case Calibration():
                self.print_lines(*_fit_lines(event))
            case DiscriminatingTrial():
                apart = ", ".join(map(str, event.hypotheses))
                self.print_lines(f"the next trial discriminates between: {apart}")
            case Trial() | TrialScore():
                self.print_lines(*_trial_lines(event))
            case Diagnosis():
                first, trials = event.ranked[0], counted(event.trials, "trial")
                finite = math.isfinite(first.distance)
                distance = f"distance {first.distance:.4f}" if finite else "diverged"
                found = f"{first.hypothesis} ({distance}), {event.verdict}"
                self.print_lines(f"diagnosis from {trials}: {found}")

    def _show(self, now: Progress, detail: str = "") -> None:
        """Shows a stage, on one bar for all, or by a line now and then."""
        time, share = monotonic(), now.done / now.total
        if now.stage != self._stage or not share:
            self._stage, self._start = now.stage, time
        left = time_left(share, time - self._start)
        if self.bar:
            for task in self.bar.task_ids:
                self.bar.remove_task(task)
            if share < 1:
                words = ", ".join(filter(None, (detail, left)))
                self.bar.add_task(now.stage, total=100, completed=round(100 * share), detail=words)
        elif left and time - self._told >= QUIET:
            self._told = time
            self.print_lines(f"{now.stage}: {share:.0%}, {left}")


def _trial_lines(event: Trial | TrialScore) -> list[str]:
    """Returns the measured way of a trial; then its score and its fall, if the way is not all."""
    if isinstance(event, Trial):
        went, steps = event.displacement, counted(event.trajectory.steps, "step")
        # A base that is fixed or not observed has no displacement.
        way = f"{went:.3f} m forward" if went and math.isfinite(went) else steps
        return [f"trial {event.plan.name}: {way}"]
    score, trial = event.score, event.trial
    if score is DISPLACEMENT and event.fall is None:
        return []
    text = value_text(event.value, score.unit, score.most(trial.trajectory.steps))
    result = f"{score.name} {text}{fall_text(event.fall)}"
    return [f"trial {trial.plan.name} by {event.hypothesis}: {result}"]


def time_left(share: float, seconds: float) -> str:
    """Returns the time left as text, of a stage of which a share is done; nothing if unknown.

    Examples:
        >>> time_left(0.25, 20.0)
        'about 1 min 00 s left'
    """
    if not 0 < share < 1:
        return ""
    minutes, left = divmod(max(round(seconds * (1 - share) / share), 1), 60)
    return f"about {minutes} min {left:02d} s left" if minutes else f"about {left} s left"


def _rate(now: Generation) -> str:
    return f"{now.evaluations / now.seconds:.0f}" if now.seconds else "-"


def _end(last: Generation) -> str:
    diverged = last.best == -math.inf
    return (
        f"{counted(last.number, 'generation')}, {counted(last.evaluations, 'evaluation')}, "
        f"{_rate(last)}/s, "
        f"{'every simulation diverged' if diverged else f'best {last.best:.4f}'}"
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


@contextmanager
def grid_display() -> Iterator["GridDisplay"]:
    """Yields a display of grid events on standard error."""
    count, time = bars.MofNCompleteColumn(), bars.TimeElapsedColumn()
    speed = bars.TextColumn("{task.description}")
    with _bar(bars.BarColumn(bar_width=None), count, time, speed) as bar:
        yield GridDisplay(bar)


class GridDisplay(Display):
    """Displays the events of a grid: above a bar, only failures are lines.

    ``done`` cells of the ``total`` are done or have failed.
    """

    def __init__(self, bar: bars.Progress | None) -> None:
        super().__init__(bar)
        self.done = self.total = 0
        self._before, self._start = 0, monotonic()

    def __call__(self, event: GridBegins | CellEnds) -> None:
        """Displays an event."""
        if isinstance(event, GridBegins):
            self.done, self.total = event.finished, event.total
            self._before, self._start = event.finished, monotonic()
            if self.bar:
                self.bar.add_task("", total=event.total, completed=event.finished)
            elif event.finished:
                self.print_lines(f"{event.finished} of {event.total} were done before")
            return
        self.done = event.number
        seconds = monotonic() - self._start
        speed = pace(event.number - self._before, event.total - event.number, seconds)
        if self.bar:
            self.bar.update(self.bar.task_ids[0], completed=event.number, description=speed)
        if event.error is not None or not self.bar:
            end = f"failed: {event.error}" if event.error else f"done in {event.seconds:.1f} s"
            line = f"[{event.number}/{event.total}] {event.name}: {end}"
            self.print_lines("; ".join(filter(None, (line, speed))))


def pace(done: int, left: int, seconds: float) -> str:
    """Returns the rate of cells and the time left as text; nothing at the end.

    Examples:
        >>> pace(10, 35, 600.0)
        '60 an hour, 0 h 35 min left'
    """
    if not (done and left and seconds > 0):
        return ""
    rate = done / seconds
    minutes = math.ceil(left / rate / 60)
    return f"{3600 * rate:.0f} an hour, {minutes // 60} h {minutes % 60:02d} min left"
