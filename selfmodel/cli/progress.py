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
from selfmodel.faults.hypothesis import INTACT
from selfmodel.progress import Progress, time_left, timed
from selfmodel.recovery.falls import fall_of, fall_text
from selfmodel.recovery.result import (
    DiscriminatingTrial,
    Event,
    Restored,
    SearchBegins,
    SelfModelWarning,
    TrialScore,
)
from selfmodel.recovery.scores import DISPLACEMENT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import UNDETERMINED, Calibration
from selfmodel.studies.grid import CellEnds, GridBegins
from selfmodel.trials.trial import Trial

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
def display(robot: Robot | None = None) -> Iterator[Callable[[Event], None]]:
    """Yields a function that displays the events of a diagnosis, or of a recovery of a robot."""
    names = ("{task.description}", "{task.percentage:.0f} %", "{task.fields[detail]}")
    text, share, detail = map(bars.TextColumn, names)
    with _bar(text, bars.BarColumn(bar_width=None), share, detail, transient=True) as bar:
        yield _Events(bar, robot)


class _Events(Display):
    def __init__(self, bar: bars.Progress | None, robot: Robot | None) -> None:
        super().__init__(bar)
        self._robot, self._best = robot, INTACT
        self._search, self._stage = SearchBegins(""), timed(self._show)
        self._told = monotonic()

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins():
                self._search = event
                self._show(Progress(event.search, 0, 1))
            case Generation():
                # Without the hypothesis, the bar fits a narrow terminal.
                now = Progress(self._search.search, event.number, event.total, event.seconds)
                self._show(now, event.detail)
                if event.number == event.total:
                    self.print_lines(f"{self._search}: {event}")
            case Progress():
                self._stage(event)
            case ChosenComparator() | DiscriminatingTrial() | Restored() | SelfModelWarning():
                self.print_lines(str(event))
            case Calibration():
                self.print_lines(*_fit_lines(event))
            case Trial() | TrialScore():
                self.print_lines(*self._trial_lines(event))
            case Diagnosis():
                self._best = event.best
                first, trials = event.ranked[0], counted(event.trials, "trial")
                finite = math.isfinite(first.distance)
                distance = f"distance {first.distance:.4f}" if finite else "diverged"
                found = f"{first.hypothesis} ({distance}), {event.verdict}"
                self.print_lines(f"diagnosis from {trials}: {found}")

    def _trial_lines(self, event: Trial | TrialScore) -> list[str]:
        """Returns the way and the fall of a trial; then its score, if the way is not all."""
        if isinstance(event, TrialScore):
            return [] if event.score is DISPLACEMENT and event.fall is None else [str(event)]
        went, steps = event.displacement, counted(event.trajectory.steps, "step")
        # A base that is fixed or not observed has no displacement.
        way = f"{went:.3f} m forward" if went and math.isfinite(went) else steps
        fall = fall_of(self._robot, self._best, event) if self._robot else None
        return [f"trial {event.plan.name}: {way}{fall_text(fall)}"]

    def _show(self, now: Progress, detail: str = "") -> None:
        """Shows a stage, on one bar for all, or by a line now and then."""
        share = now.done / now.total
        left = time_left(share, now.seconds)
        if self.bar:
            for task in self.bar.task_ids:
                self.bar.remove_task(task)
            if share < 1:
                words = ", ".join(filter(None, (detail, left)))
                self.bar.add_task(now.stage, total=100, completed=round(100 * share), detail=words)
        elif left and monotonic() - self._told >= QUIET:
            self._told = monotonic()
            self.print_lines(str(now))


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

    def __call__(self, event: GridBegins | CellEnds) -> None:
        """Displays an event."""
        if isinstance(event, GridBegins):
            self.done, self.total = event.finished, event.total
            if self.bar:
                self.bar.add_task("", total=event.total, completed=event.finished)
            if event.earlier or (event.finished and not self.bar):
                self.print_lines(str(event))
            return
        self.done = event.number
        if self.bar:
            task = self.bar.task_ids[0]
            self.bar.update(task, completed=event.number, description=event.pace)
        if event.error is not None or not self.bar:
            self.print_lines(str(event))
