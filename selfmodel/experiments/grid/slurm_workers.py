"""Jobs of Slurm as workers, one cell each, by submitit; needs the extra ``slurm``."""

import math
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from selfmodel.errors import InputError
from selfmodel.experiments.grid.workers import Workers

Answer = TypeVar("Answer")

JOBS = "slurm"
"""Folder of the study for submitit's files and the output of the jobs; its name of Slurm."""

POLL_SECONDS = 0.5
"""Time between two checks of the jobs; submitit asks Slurm itself at most once a minute."""

MAX_FAILED_CHECKS = 240
"""Consecutive failed checks of a job, two minutes of them, after which its cell is lost."""

COMMON = ("cluster", "mem_gb", "cpus_per_task", "nodes", "timeout_min")
"""Options whose names submitit has for every cluster; others are those of ``sbatch``."""


@contextmanager
def slurm(options: Mapping[str, str], count: int, folder: Path) -> Iterator[Workers]:
    """Yields jobs of Slurm.

    Args:
        options: Options of the jobs: ``timeout`` as ``HH:MM:SS``, those of ``COMMON``, and those
            of ``sbatch``, such as ``partition``; ``cluster=local`` runs the jobs on this machine.
        count: Number of jobs at a time.
        folder: Folder of the study.

    Raises:
        InputError: submitit is not installed, there is no Slurm, or an option is invalid.
    """
    try:
        import submitit  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise InputError(
            "jobs of Slurm need the package submitit: pip install 'selfmodel[slurm]'"
        ) from error
    given = {"cpus_per_task": "1", "cluster": JOBS, **options}
    cluster = given.pop("cluster")
    try:
        jobs = submitit.AutoExecutor(folder / JOBS, cluster=cluster)
        jobs.update_parameters(**dict(parameter(*option) for option in given.items()))
    except (RuntimeError, ValueError, NameError, TypeError, AssertionError) as error:
        raise InputError(f"jobs of Slurm: {' '.join(str(error).split())[:500]}") from error
    with _JobExecutor(jobs) as executor:
        yield Workers(executor, count)


def parameter(name: str, value: str) -> tuple[str, Any]:
    """Returns an option as submitit's parameter.

    Raises:
        InputError: The time or the number is invalid.
    """
    if name == "timeout":
        try:
            hours, minutes, seconds = (int(text) for text in value.split(":"))
        except ValueError:
            raise InputError(f"expected timeout=HH:MM:SS, such as 04:00:00, got {value}") from None
        return "timeout_min", 60 * hours + minutes + -(-seconds // 60)
    if name == "mem_gb":
        return name, _memory(value)
    if name in COMMON:
        return name, _whole_number(name, value)
    return f"slurm_{name}", int(value) if value.isdecimal() else value


def _memory(value: str) -> float:
    with suppress(ValueError):
        if 0 < float(value) < math.inf:
            return float(value)
    raise InputError(f"expected mem_gb as a number of GB, such as 4 or 1.5, got {value}")


def _whole_number(name: str, value: str) -> int:
    with suppress(ValueError):
        if int(value) > 0:
            return int(value)
    what = "of minutes, such as 240" if name == "timeout_min" else "such as 1"
    raise InputError(f"expected {name} as a positive whole number {what}, got {value}")


class _JobExecutor(Executor):
    """Executor whose calls are jobs of submitit; a job that ends without an answer is an exit.

    Args:
        jobs: Executor of submitit, which has no futures of the standard library.
    """

    def __init__(self, jobs: Any) -> None:  # noqa: ANN401  # submitit's, an extra
        self._jobs = jobs
        self._running: dict[Future[Any], Any] = {}
        self._failed_checks: Counter[Future[Any]] = Counter()
        self._closed = threading.Event()
        self._poll = threading.Thread(target=self._wait_for_jobs, daemon=True)
        self._poll.start()

    def submit(
        self,
        fn: Callable[..., Answer],
        /,
        *args: Any,  # noqa: ANN401  # of any function
        **kwargs: Any,  # noqa: ANN401
    ) -> "Future[Answer]":
        """Calls a function in a job."""
        future: Future[Answer] = Future()
        future.set_running_or_notify_cancel()
        self._running[future] = self._jobs.submit(fn, *args, **kwargs)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:  # noqa: ARG002, FBT001, FBT002  # as in Executor
        """Cancels the jobs that run or wait."""
        self._closed.set()
        self._poll.join()
        for job in self._running.values():
            job.cancel(check=False)

    def _wait_for_jobs(self) -> None:
        while not self._closed.wait(POLL_SECONDS):
            for future, job in list(self._running.items()):
                if self._is_done(future, job):
                    del self._running[future]
                    _set(future, job)

    def _is_done(self, future: "Future[Any]", job: Any) -> bool:  # noqa: ANN401  # submitit's, an extra
        """Checks a job; one that cannot be checked for long is lost, and cancelled."""
        try:
            done = bool(job.done())
        except Exception as error:  # noqa: BLE001  # any error, of the file system or of submitit's reading of Slurm's output, would end the thread, and no future would end
            self._failed_checks[future] += 1
            if self._failed_checks[future] >= MAX_FAILED_CHECKS:
                del self._running[future], self._failed_checks[future]
                with suppress(OSError):
                    job.cancel(check=False)
                future.set_exception(_unchecked(job, error))
            return False
        self._failed_checks.pop(future, None)
        return done


def _unchecked(job: Any, error: Exception) -> BrokenExecutor:  # noqa: ANN401  # submitit's, an extra
    line = " ".join(f"{type(error).__name__}: {error}".split())
    return BrokenExecutor(
        f"job {job.job_id} could not be checked {MAX_FAILED_CHECKS} times in a row: {line[:300]}"
    )


def _set(future: "Future[Any]", job: Any) -> None:  # noqa: ANN401  # submitit's, an extra
    """Gives a future the answer of a job that ended."""
    try:
        future.set_result(job.result())
    except Exception:  # noqa: BLE001  # an error of the job, or of submitit, would end the thread
        output = job.paths.stderr
        future.set_exception(BrokenExecutor(f"job {job.job_id} ended without an answer: {output}"))
