"""Grid of independent runs, each in its own folder, that is resumable after an interruption.

The grid is independent of robots. Finished parts are kept; failed parts are tried again by the
next call. One process at a time runs a grid in a folder (see ``folder.exclusive``).
"""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.experiments.grid.folder import (
    check_definition,
    exclusive,
    is_finished,
    write_definition,
    write_part,
)
from selfmodel.experiments.grid.worker_pool import WorkerExit, run_tasks


@dataclass(frozen=True)
class Job:
    """Definition of one run.

    Attributes:
        key: Name of the run and of its folder: letters, digits, ``.``, ``_``, ``-``, ``=``, ``%``.
        parameters: All inputs of the results except the seed, as JSON.
        seed: Seed of all random numbers.
        parts: Names of the parts to run, in order; a later call may request other parts.
    """

    key: str
    parameters: Mapping[str, Any] = field(hash=False)
    seed: int
    parts: tuple[str, ...] = ("result",)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w[\w.=%-]*", self.key, re.ASCII):
            raise ValueError(f"expected a key that is a valid folder name, got {self.key!r}")

    @property
    def definition(self) -> Mapping[str, Any]:
        """Content of the run's ``run.json``."""
        return {"key": self.key, "seed": self.seed, "parameters": dict(self.parameters)}


Work = Callable[[Job, str, Path], Any]
"""Function that runs one part of a job in the folder of its run and returns the result as JSON."""


@dataclass(frozen=True)
class GridBegins:
    """Start or resumption of a grid.

    Attributes:
        total: Number of parts of all runs.
        finished: Number of parts that were finished before.
    """

    total: int
    finished: int


@dataclass(frozen=True)
class PartEnds:
    """End of a part of a run.

    Attributes:
        key: Key of the run.
        part: Name of the part.
        number: Number of parts that have finished or failed so far.
        total: Number of parts of all runs.
        seconds: Wall time of the part.
        error: Reason of a failure; None for a finished part.
    """

    key: str
    part: str
    number: int
    total: int
    seconds: float
    error: str | None


def run_grid(
    folder: Path,
    jobs: Sequence[Job],
    work: Work,
    *,
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Runs all unfinished parts of a grid and returns the failed ones.

    The failure of a part is written to its file and stops no other part. An unexpected exception
    ends its worker process, with a traceback on standard error, and counts as a failure.

    Args:
        folder: Folder of the grid, with one folder per run.
        jobs: The runs, with unique keys.
        work: Runs one part. Worker processes receive the function pickled, so it must be defined
            at the top of a module.
        workers: Number of worker processes.
        on_progress: Callback for the start of the grid and for every part that ends.

    Raises:
        InputError: A run in the folder has another definition, or another process runs a grid
            there; no part has been run then.
        OSError: The folder cannot be written.
    """
    if len({job.key for job in jobs}) < len(jobs):
        raise ValueError("expected a unique key per run of a grid")
    with exclusive(folder):
        for job in jobs:
            check_definition(folder / job.key, job.definition)
        for job in jobs:
            write_definition(folder / job.key, job.definition)
        chains = [
            [(job, part) for part in job.parts if not is_finished(folder / job.key, part)]
            for job in jobs
        ]
        total = sum(len(job.parts) for job in jobs)
        before = total - sum(map(len, chains))
        on_progress(GridBegins(total, before))
        failed = []
        with closing(run_tasks(partial(_perform, folder, work), chains, workers)) as answers:
            for number, ((job, part), answer) in enumerate(answers, start=before + 1):
                seconds, error = (
                    (0.0, _write_exit(folder / job.key, part, answer))
                    if isinstance(answer, WorkerExit)
                    else answer
                )
                ends = PartEnds(job.key, part, number, total, seconds, error)
                if error is not None:
                    failed.append(ends)
                on_progress(ends)
    return tuple(failed)


def _perform(folder: Path, work: Work, task: tuple[Job, str]) -> tuple[float, str | None]:
    """Runs a part in a worker process; returns its wall time and, if it failed, its error."""
    job, part = task
    run, start = folder / job.key, perf_counter()
    try:
        outcome = {"status": "done", "result": work(job, part, run)}
    except (InputError, WorkError, OSError, MemoryError) as error:
        outcome = {"status": "failed", "error": str(error) or type(error).__name__}
    seconds = perf_counter() - start
    write_part(run, part, {**outcome, "seconds": seconds})
    return seconds, outcome.get("error")


def _write_exit(run: Path, part: str, answer: WorkerExit) -> str:
    """Writes and returns the error of a part whose worker process exited."""
    error = f"its process ended with status {answer.status}; standard error may have the reason"
    write_part(run, part, {"status": "failed", "error": error})
    return error
