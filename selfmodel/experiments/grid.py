"""A grid: many independent runs, each in a folder of its own, that goes on where it was stopped.

It knows nothing of robots. ``FOLDER/KEY/run.json`` says what a run is made of, and is never
overwritten; ``FOLDER/KEY/parts/PART.json`` holds what came of each of its parts, and comes to be
whole or not at all. What is in a file is not done again; a part that failed is tried again. Several
processes, on one machine or on many that share the folder, may work at one grid: a part is done by
the first to get there, and the others find it done.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any
from urllib.parse import quote, unquote

from selfmodel.errors import InputError, WorkError
from selfmodel.experiments.worker_pool import Died, work_off
from selfmodel.logs.atomic import lock_folder, write_atomic

PARTS = "parts"
RUN = "run.json"


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes:
        key: Names it and its folder: letters, digits, ``.``, ``_``, ``-``, ``=`` and ``%``.
        parameters: Everything that its results depend on beside the seed, as JSON has it.
        seed: Every random choice comes from it.
        parts: What is to be done, in this order; a later call may ask for others.
    """

    key: str
    parameters: Mapping[str, Any] = field(hash=False)
    seed: int
    parts: tuple[str, ...] = ("result",)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w[\w.=%-]*", self.key, re.ASCII):
            raise ValueError(f"the key of a run must be able to name a folder, got {self.key!r}")


Work = Callable[[Job, str, Path], Any]
"""Does one part of a run in its folder, and returns what is to be kept, as JSON has it."""


@dataclass(frozen=True)
class GridBegins:
    """A grid begins or goes on.

    Attributes:
        total: Parts of all its runs.
        finished: Those that were done before.
    """

    total: int
    finished: int


@dataclass(frozen=True)
class PartEnds:
    """A part of a run ended.

    Attributes:
        key: The run.
        part: The part.
        number: How many parts are done or have failed by now.
        total: Parts of all runs.
        seconds: How long it took.
        error: Why it failed; None where it is done.
    """

    key: str
    part: str
    number: int
    total: int
    seconds: float
    error: str | None


@dataclass(frozen=True)
class Finished:
    """A part that is done, as the files say.

    Attributes:
        key: The run.
        parameters: What it is made of.
        seed: Its seed.
        part: The part.
        result: What came of it.
    """

    key: str
    parameters: Mapping[str, Any]
    seed: int
    part: str
    result: Any


def run_grid(
    folder: Path,
    jobs: Sequence[Job],
    work: Work,
    *,
    workers: int,
    on_event: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Does what is not done yet, and returns what failed.

    A failure is kept in its part's file and stops no other. An error that nobody foresaw ends the
    process that was at it, with its traceback on standard error, and counts as a failure.

    Args:
        folder: Where the runs are kept.
        jobs: The runs, each with a key of its own.
        work: Does one part; the processes get it pickled, so it stands at the top of a module.
        workers: Processes at a time.
        on_event: Is told what happens.

    Raises:
        InputError: A run was made of something else; nothing has been done then.
        OSError: The folder cannot be written.
    """
    if len({job.key for job in jobs}) < len(jobs):
        raise ValueError("every run of a grid needs a key of its own")
    for job in jobs:
        _check(folder / job.key, job)
    for job in jobs:
        if not (folder / job.key / RUN).exists():
            _enrol(folder / job.key, job)
    chains = [
        [(job, part) for part in job.parts if not _is_done(folder / job.key, part)] for job in jobs
    ]
    total = sum(len(job.parts) for job in jobs)
    before = total - sum(map(len, chains))
    on_event(GridBegins(total, before))
    failed = []
    with closing(work_off(partial(_perform, folder, work), chains, workers)) as answers:
        for number, ((job, part), answer) in enumerate(answers, start=before + 1):
            seconds, error = _kept_death(folder / job.key, part, answer)
            ends = PartEnds(job.key, part, number, total, seconds, error)
            if error is not None:
                failed.append(ends)
            on_event(ends)
    return tuple(failed)


def finished(folder: Path) -> Iterator[Finished]:
    """Gives every part that is done in the folder of a grid, in the order of the names."""
    for run in runs(folder):
        said = _read(run / RUN)
        for path in sorted((run / PARTS).glob("*.json")):
            kept = _read(path)
            if kept["status"] == "done":
                part = unquote(path.stem)
                yield Finished(said["key"], said["parameters"], said["seed"], part, kept["result"])


def runs(folder: Path) -> list[Path]:
    """Returns the folders of all runs of a grid, finished or not."""
    return sorted(path.parent for path in folder.glob(f"*/{RUN}"))


def parameters_of(run: Path) -> Mapping[str, Any]:
    """Returns what the run in a folder is made of.

    Raises:
        InputError: The file does not say.
    """
    parameters: Mapping[str, Any] = _read(run / RUN)["parameters"]
    return parameters


def check_shared(folder: Path, shared: Mapping[str, Any], what: str) -> None:
    """Checks that all runs of a study share what those that are asked for do.

    Args:
        folder: Of the study; its runs are in ``runs``.
        shared: What they are to share, as each says it in its parameter ``shared``.
        what: What the study is called.

    Raises:
        InputError: A run was made otherwise; the sentence says in what.
    """
    for run in runs(folder / "runs"):
        where = difference(parameters_of(run)["shared"], shared)
        if where:
            raise InputError(
                f"{folder} holds {what} that was made otherwise ({where}): choose another folder"
            )


def difference(there: Any, asked: Any, name: str = "") -> str | None:  # noqa: ANN401  # JSON
    """Returns where two JSON values first differ, as a clause; None where they do not."""
    if isinstance(there, dict) and isinstance(asked, dict):
        for key in sorted(there.keys() | asked.keys()):
            inner = difference(there.get(key), asked.get(key), f"{name}.{key}".lstrip("."))
            if inner:
                return inner
        return None
    return None if there == asked else f"{name} is {json.dumps(there)} there, asked is {asked!r}"


def _perform(folder: Path, work: Work, task: tuple[Job, str]) -> tuple[float, str | None]:
    """Does a part in a process of its own; returns the seconds, and why it failed if it did."""
    job, part = task
    run, start = folder / job.key, perf_counter()
    with lock_folder(run):
        if _is_done(run, part):  # another process got there first
            return 0.0, None
        try:
            kept = {"status": "done", "result": work(job, part, run)}
        except (InputError, WorkError, OSError, MemoryError) as error:
            kept = {"status": "failed", "error": str(error) or type(error).__name__}
        seconds = perf_counter() - start
        _keep(run, part, {**kept, "seconds": seconds})
    return seconds, kept.get("error")


def _kept_death(
    run: Path, part: str, answer: tuple[float, str | None] | Died
) -> tuple[float, str | None]:
    """The seconds and the error of a part; of a process that died this one keeps it."""
    if not isinstance(answer, Died):
        return answer
    why = f"its process ended with status {answer.status}; standard error may say more"
    _keep(run, part, {"status": "failed", "error": why})
    return 0.0, why


def _check(run: Path, job: Job) -> None:
    if not (run / RUN).exists():
        return
    where = difference(_read(run / RUN), _described(job))
    if where:
        raise InputError(
            f"{run} holds a run that was made otherwise ({where}): nothing is overwritten, choose "
            f"another folder, or delete that one"
        )


def _enrol(run: Path, job: Job) -> None:
    (run / PARTS).mkdir(parents=True, exist_ok=True)
    with lock_folder(run):
        _check(run, job)
        if not (run / RUN).exists():
            write_atomic(run / RUN, json.dumps(_described(job), indent=1, allow_nan=False).encode())


def _described(job: Job) -> Any:  # noqa: ANN401  # JSON
    said = {"key": job.key, "seed": job.seed, "parameters": dict(job.parameters)}
    return json.loads(json.dumps(said, allow_nan=False))  # tuples are lists in a file


def _is_done(run: Path, part: str) -> bool:
    path = _path(run, part)
    return path.exists() and _read(path)["status"] == "done"


def _keep(run: Path, part: str, kept: Mapping[str, Any]) -> None:
    path = _path(run, part)
    path.parent.mkdir(exist_ok=True)  # who wants a run made anew may have deleted its results
    write_atomic(path, json.dumps(kept, indent=1, allow_nan=False).encode())


def _path(run: Path, part: str) -> Path:
    return run / PARTS / f"{quote(part, safe='')}.json"


def _read(path: Path) -> Any:  # noqa: ANN401  # JSON
    try:
        return json.loads(path.read_bytes())
    except ValueError as error:
        raise InputError(
            f"{path}: expected a file that a grid wrote, got no JSON ({error}): delete its folder, "
            f"and the run is made anew"
        ) from error
