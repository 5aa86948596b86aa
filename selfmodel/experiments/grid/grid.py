"""Grid of independent runs, each in its own folder, that is resumable after an interruption.

The grid is independent of robots. Finished parts are kept; failed parts are tried again by the
next call. One process at a time runs a grid in a folder (see ``lock.exclusive``).
"""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from selfmodel.experiments.grid.definition import (
    check_definition,
    check_extensible,
    check_versions,
    write_definition,
)
from selfmodel.experiments.grid.job import Job, Work
from selfmodel.experiments.grid.lock import exclusive
from selfmodel.experiments.grid.part_runner import PartAnswer, run_part
from selfmodel.experiments.grid.parts import failed, part_bytes, unfinished, write_part
from selfmodel.experiments.grid.worker_pool import WorkerExit, run_tasks


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

    The failure of a part is written to its file and stops no other part; the traceback of an
    unexpected exception is in a file of the run's folder. If the files of a part cannot be written,
    such as on a full disk, the grid ends: the other parts would fail too.

    Args:
        folder: Folder of the grid, with one folder per run.
        jobs: The runs, with unique keys.
        work: Runs one part. Worker processes receive the function pickled, so it must be defined
            at the top of a module.
        workers: Number of worker processes.
        on_progress: Callback for the start of the grid and for every part that ends.

    Raises:
        InputError: A run in the folder has another definition or other versions, a file there is
            damaged or altered, or another process runs a grid there; no part has been run then.
        OSError: The folder cannot be written; all finished parts are kept.
    """
    if len({job.key for job in jobs}) < len(jobs):
        raise ValueError("expected a unique key per run of a grid")
    with exclusive(folder):
        check_versions(folder)
        for job in jobs:
            check_definition(folder / job.key, job.definition)
        chains = [
            [(job, part) for part in unfinished(folder / job.key, job.definition, job.parts)]
            for job in jobs
        ]
        if any(chains):
            check_extensible(folder)
        for job in jobs:
            write_definition(folder / job.key, job.definition)
        total = sum(len(job.parts) for job in jobs)
        before = total - sum(map(len, chains))
        on_progress(GridBegins(total, before))
        failures = []
        with closing(run_tasks(partial(run_part, folder, work), chains, workers)) as answers:
            for number, ((job, part), end) in enumerate(answers, start=before + 1):
                answer = _write_exit(folder, job, part, end) if isinstance(end, WorkerExit) else end
                if answer.ends_grid:
                    raise OSError(answer.error)
                ends = PartEnds(job.key, part, number, total, answer.seconds, answer.error)
                if ends.error is not None:
                    failures.append(ends)
                on_progress(ends)
    return tuple(failures)


def _write_exit(folder: Path, job: Job, part: str, end: WorkerExit) -> PartAnswer:
    """Writes and returns the error of a part whose worker process exited."""
    error = f"its process ended with status {end.status}; standard error may have the reason"
    write_part(folder / job.key, part, part_bytes(job.definition, part, failed(error)))
    return PartAnswer(0.0, error)
