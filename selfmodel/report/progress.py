"""Progress of a recovery in its folder: its searches, and on request a report after each trial."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError, WorkError
from selfmodel.evolution import Generation
from selfmodel.logs.files import replace_file
from selfmodel.logs.results import Search, write_searches
from selfmodel.recovery.result import Event, SearchBegins
from selfmodel.report.charts import REPORT, Report, html_of
from selfmodel.report.content import NOT_FINISHED, report_of, searches_section
from selfmodel.report.subject import Subject, title_of
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.trials.trial import Trial, by_stage


@dataclass(eq=False)
class RunProgress:
    """Records the events of a recovery, and hands every event on.

    The report is made of what the recovery has in memory, by simulations of its own: the recovery
    computes the same numbers with and without it.

    If it ``reports``, the report in the folder of the run is rewritten after each trial, as soon as
    it is diagnosed, and before the first diagnosis.
    """

    folder: Path
    robot: Robot
    on_event: Callable[[Event], None] = lambda _event: None
    threads: int = 0
    reports: bool = False
    _begun: list[tuple[SearchBegins, list[Generation]]] = field(default_factory=list)
    _trials: list[Trial] = field(default_factory=list)
    _diagnoses: list[Diagnosis] = field(default_factory=list)
    _comparator: ChosenComparator | None = None
    _calibration: Calibration | None = None

    def __call__(self, event: Event) -> None:
        """Records an event."""
        match event:
            case SearchBegins():
                self._begun.append((event, []))
            case Generation() if self._begun:
                self._begun[-1][1].append(event)
            case ChosenComparator():
                self._comparator = event
            case Calibration():
                self._calibration = event
            case Trial():
                self._trials.append(event)
            case Diagnosis():
                self._diagnoses.append(event)
        self.on_event(event)
        is_news = isinstance(event, Diagnosis) or (isinstance(event, Trial) and not self._diagnoses)
        if self.reports and is_news:
            replace_file(self.folder / REPORT, html_of(self.report()))

    @property
    def searches(self) -> tuple[Search, ...]:
        """The searches so far."""
        return tuple(
            Search(
                kind=begun.kind,
                hypothesis="" if begun.hypothesis is None else str(begun.hypothesis),
                best=tuple(one.best if one.best > -math.inf else None for one in generations),
                evaluations=tuple(one.evaluations for one in generations),
            )
            for begun, generations in self._begun
        )

    def report(self) -> Report:
        """Returns the report of what happened so far, which states that it is not finished."""
        name = self.folder.resolve().name
        if not self._diagnoses or self._comparator is None:
            last = f"the trial {self._trials[-1].plan.name} was run" if self._trials else ""
            section = searches_section(self.searches)
            return Report(
                title=title_of(self.robot, name),
                headline=f"{NOT_FINISHED}: {last or 'it begins'}.",
                sections=() if section is None else (section,),
            )
        damaged, healthy = by_stage(self._trials)
        subject = Subject(
            name=name,
            robot=self.robot,
            healthy=healthy,
            damaged=damaged[: self._diagnoses[-1].trials],
            diagnoses=tuple(self._diagnoses),
            comparator=self._comparator.comparator,
            calibration=self._calibration,
            searches=self.searches,
            threads=self.threads,
        )
        return report_of(subject, finished=False)

    @contextmanager
    def kept_on_failure(self) -> Iterator[None]:
        """Writes the searches if an error ends the recovery, with a note where its trials are.

        An error before any search, such as that the folder has other files, leaves it as it is.
        """
        try:
            yield
        except BaseException as error:
            if self._trials:
                error.add_note(f"the finished trials are in {self.folder}")
            if self._begun:
                with suppress(OSError, WorkError, InputError):  # the first error counts
                    write_searches(self.folder, self.searches)
            raise
