"""Progress of the searches of a recovery: recorded as it happens, kept in the run's folder."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.evolution import Generation
from selfmodel.files import read_file
from selfmodel.logs.files import replace_file
from selfmodel.logs.result_files import MAX_BYTES, parse_json
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.report.subject import Search
from selfmodel.trials.trial import Trial

SEARCHES = "searches.json"
"""File of the progress of all searches, in the folder of a run."""


@dataclass(frozen=True, eq=False)
class ProgressRecorder:
    """Records the generations of each search, and hands every event on.

    Attributes:
        on_event: Callback that every event is handed to.
        begun: Each search that began, with its generations.
        finished: Names of the trials that ended.
    """

    on_event: Callable[[Event], None]
    begun: list[tuple[SearchBegins, list[Generation]]] = field(default_factory=list)
    finished: list[str] = field(default_factory=list)

    def __call__(self, event: Event) -> None:
        """Records an event."""
        if isinstance(event, SearchBegins):
            self.begun.append((event, []))
        elif isinstance(event, Generation) and self.begun:
            self.begun[-1][1].append(event)
        elif isinstance(event, Trial):
            self.finished.append(event.plan.name)
        self.on_event(event)

    @property
    def searches(self) -> tuple[Search, ...]:
        """The searches so far."""
        return tuple(
            Search(
                kind=begun.kind,
                hypothesis="" if begun.hypothesis is None else str(begun.hypothesis),
                best=tuple(one.best for one in generations),
                evaluations=tuple(one.evaluations for one in generations),
            )
            for begun, generations in self.begun
        )

    @contextmanager
    def kept_on_failure(self, folder: Path) -> Iterator[None]:
        """Writes the progress if an error ends the recovery, with a note where its trials are.

        Args:
            folder: Folder of the run. An error before any search, such as that the folder has other
                files, leaves it as it is.
        """
        try:
            yield
        except BaseException as error:
            if self.finished:
                error.add_note(f"the finished trials are in {folder}")
            if self.begun:
                with suppress(OSError, WorkError):  # the first error is the one to report
                    self.write(folder)
            raise

    def write(self, folder: Path) -> None:
        """Writes the progress into the folder of a run.

        Raises:
            LogWriteError: The disk is full, or failed.
        """
        values = [
            {**asdict(search), "best": [_finite(one) for one in search.best]}
            for search in self.searches
        ]
        replace_file(folder / SEARCHES, json.dumps(values, indent=1, allow_nan=False).encode())


def read_searches(folder: Path) -> tuple[Search, ...]:
    """Returns the progress in the folder of a run; none if it was not recorded.

    Raises:
        InputError: The file is damaged.
    """
    path = folder / SEARCHES
    if not path.exists():
        return ()
    try:
        items: Any = parse_json(read_file(path, "the progress of searches", MAX_BYTES))
        return tuple(
            Search(
                kind=str(item["kind"]),
                hypothesis=str(item["hypothesis"]),
                best=tuple(float("-inf") if one is None else float(one) for one in item["best"]),
                evaluations=tuple(int(one) for one in item["evaluations"]),
            )
            for item in items
        )
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(
            f"{path}: expected the progress of the searches of a run: {error}; move it away, and "
            f"the report is made without it"
        ) from error


def _finite(value: float) -> float | None:
    """JSON has no infinity, which is the fitness if every simulation diverged."""
    return value if value > float("-inf") else None
