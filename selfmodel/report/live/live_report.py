"""The report of a recovery that goes on: made anew after each diagnosis, beside the recovery.

Each report is made by a process of its own from the folder of the run, so the recovery computes the
same numbers with and without a report. Until the first diagnosis, the page has the searches alone.
"""

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.report.document import Report
from selfmodel.report.html import html_of
from selfmodel.report.live.server import Shown, serving
from selfmodel.report.progress import ProgressRecorder
from selfmodel.report.sections.searches import searches_section
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial

READ_SECONDS = 6.0
"""Time since the last request within which a browser counts as open; a page asks every 2 s."""

LAST_PAGE_SECONDS = 5.0
"""Time for which the last page is served to an open browser, at most."""


@dataclass(eq=False)
class LiveReport:
    """A report that follows the events of a recovery.

    Attributes:
        folder: Folder of the run.
        title: Title of the page.
        shown: What the server sends.
        workspace: Folder of the reports that are made.
        options: Options of ``selfmodel report``, such as the comparator of the recovery.
        maker: Process that makes a report; None if none does.
        is_stale: Whether a diagnosis was added since the last report was begun.
    """

    folder: Path
    title: str
    shown: Shown
    workspace: Path
    options: tuple[str, ...] = ()
    progress: ProgressRecorder = field(default_factory=lambda: ProgressRecorder(lambda _: None))
    maker: subprocess.Popen[bytes] | None = None
    is_stale: bool = False
    has_report: bool = False

    def __call__(self, event: Event) -> None:
        """Follows an event."""
        self.progress(event)
        line = line_of(event)
        if line:
            self.shown.line = line
        if isinstance(event, Diagnosis):
            self.is_stale = True
        self._collect()
        if self.is_stale and self.maker is None:
            self._make()
        if not self.has_report and isinstance(event, SearchBegins | Trial | Calibration):
            self._show_searches()

    def finish(self, page: bytes) -> None:
        """Shows the last page, and waits until an open browser has it."""
        self.shown.is_running = False
        self.shown.line = "The recovery has ended; this report is in its folder."
        self.shown.show(page)
        end = monotonic() + LAST_PAGE_SECONDS
        while self.shown.is_read(READ_SECONDS) and monotonic() < end:
            if self.shown.read_version == self.shown.version:
                return
            sleep(0.05)

    def stop(self) -> None:
        """Ends the process that makes a report."""
        if self.maker is not None:
            self.maker.kill()
            self.maker.wait()
            self.maker = None

    @property
    def _file(self) -> Path:
        return self.workspace / "report.html"

    def _make(self) -> None:
        with suppress(OSError):
            self._file.unlink(missing_ok=True)
        # -P: a file such as random.py in the current folder is not imported.
        command = [sys.executable, "-P", "-m", "selfmodel", "report", str(self.folder.absolute())]
        self.is_stale = False
        with suppress(OSError):  # no memory or no disk for a report does not end a recovery
            self.maker = subprocess.Popen(  # noqa: S603  # this program
                [*command, *self.options, "--threads", "1", "--out", str(self._file)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

    def _collect(self) -> None:
        if self.maker is None or self.maker.poll() is None:
            return
        if self.maker.returncode == 0:
            with suppress(OSError):
                self.shown.show(self._file.read_bytes())
                self.has_report = True
        self.maker = None

    def _show_searches(self) -> None:
        section = searches_section(self.progress.searches)
        headline = f"The recovery goes on: {self.shown.line}"
        sections = () if section is None else (section,)
        self.shown.show(html_of(Report(self.title, headline, (), sections)))


@contextmanager
def live_report(
    folder: Path, title: str, announce: Callable[[str], None], options: Sequence[str] = ()
) -> Iterator[LiveReport]:
    """Yields a report that is served while a recovery runs.

    Args:
        folder: Folder of the run.
        title: Title of the page.
        announce: Called with the address of the page.
        options: Options of ``selfmodel report``.

    Raises:
        InputError: The page of a report was not built.
        WorkError: The report cannot be served.
    """
    with tempfile.TemporaryDirectory(prefix="selfmodel-report-") as workspace:
        live = LiveReport(folder, title, Shown(line="it begins."), Path(workspace), tuple(options))
        live.shown.show(html_of(Report(title, "The recovery goes on: it begins.", (), ())))
        with serving(live.shown) as address:
            announce(address)
            try:
                yield live
            finally:
                live.stop()


def line_of(event: Event) -> str:
    """Returns what an event means at the moment, as a sentence; "" for other events."""
    match event:
        case SearchBegins(kind, hypothesis):
            purpose = "" if hypothesis is None else f" for {hypothesis}"
            return f"{'a diagnosis' if kind == 'diagnostic' else f'a repair{purpose}'} begins."
        case Generation():
            best = "none" if math.isinf(event.best) else f"{event.best:.4g}"
            return f"generation {event.number} of {event.total}, best fitness {best}."
        case Calibration():
            return "the self-model was calibrated."
        case Trial():
            return f"the trial {event.plan.name} was run."
        case Diagnosis():
            return f"diagnosis {event.best}, {event.verdict}."
    return ""
