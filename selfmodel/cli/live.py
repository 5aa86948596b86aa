"""The report that a recovery serves while it runs, and leaves in its folder."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from selfmodel.cli.output.printing import print_notes
from selfmodel.logs.files import write_new
from selfmodel.recovery.events import Event
from selfmodel.report.build import report_of
from selfmodel.report.html import html_of
from selfmodel.report.live.live_report import LiveReport, live_report
from selfmodel.report.run_folder import REPORT
from selfmodel.report.subject import TITLE, Subject


@contextmanager
def followed(folder: Path, robot: str, options: Sequence[str]) -> Iterator[LiveReport]:
    """Serves the report of a recovery, and prints its address; see ``live_report``.

    Args:
        folder: Folder of the run.
        robot: Name of the robot.
        options: Options of ``selfmodel report``, such as the comparator of the recovery.
    """
    title = TITLE.format(robot=robot, name=folder.resolve().name)
    with live_report(folder, title, lambda url: print_notes(f"report: {url}"), options) as live:
        yield live


def both(
    first: Callable[[Event], None], second: Callable[[Event], None]
) -> Callable[[Event], None]:
    """Returns a callback that calls two callbacks."""

    def called(event: Event) -> None:
        first(event)
        second(event)

    return called


def leave_report(live: LiveReport, folder: Path, subject: Subject) -> None:
    """Writes the report of a recovery that has ended into its folder, and shows it.

    A report that `selfmodel report` has written there meanwhile is kept.

    Args:
        live: The report so far.
        folder: Folder of the run.
        subject: What the report is about.

    Raises:
        LogWriteError: The disk is full, or failed.
    """
    page = html_of(report_of(subject))
    print_notes(f"report: {write_new(folder / REPORT, page)}")
    live.finish(page)
