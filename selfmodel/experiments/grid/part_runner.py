"""Execution of one part of a run in a worker process."""

import traceback
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from urllib.parse import quote

from selfmodel.errors import InputError, WorkError
from selfmodel.experiments.grid.job import Job, Work
from selfmodel.experiments.grid.parts import PartResult, done, failed, part_bytes, write_part
from selfmodel.logs.errors import is_full
from selfmodel.logs.files import make_folder, not_written, replace_file

TRACEBACKS = "tracebacks"


@dataclass(frozen=True)
class PartAnswer:
    """End of a part, as the worker process reports it.

    Attributes:
        seconds: Wall time of the part.
        error: Reason of a failure; None for a finished part.
        ends_grid: Whether the other parts would fail too: the disk is full or not writable.
    """

    seconds: float
    error: str | None
    ends_grid: bool = False


def run_part(folder: Path, work: Work, task: tuple[Job, str]) -> PartAnswer:
    """Runs a part and writes its result or its error.

    Args:
        folder: Folder of the grid.
        work: Runs a part.
        task: The job and the name of the part.
    """
    job, part = task
    run, start = folder / job.key, perf_counter()
    error: str | None = None
    try:
        try:
            made = work(job, part, run)
            outcome = done(run, made if isinstance(made, PartResult) else PartResult(made))
            seconds = perf_counter() - start
            data = part_bytes(job.definition, part, {**outcome, "seconds": seconds})
        except OSError as cause:
            if is_full(cause):
                raise not_written(cause.filename or run, cause) from cause
            error = str(cause) or type(cause).__name__
        except (InputError, WorkError, MemoryError) as cause:
            error = str(cause) or type(cause).__name__
        except Exception as cause:  # noqa: BLE001  # a plug-in may raise any exception
            # The part fails with its traceback in a file; the other parts of the grid continue.
            error = _unexpected(cause, run, part)
        seconds = perf_counter() - start
        if error is not None:
            data = part_bytes(job.definition, part, {**failed(error), "seconds": seconds})
        write_part(run, part, data)
        if error is None:
            _traceback_path(run, part).unlink(missing_ok=True)  # of an earlier failure
    except OSError as cause:
        return PartAnswer(perf_counter() - start, str(cause), ends_grid=True)
    return PartAnswer(seconds, error)


def _unexpected(cause: Exception, run: Path, part: str) -> str:
    """Writes the traceback of an unexpected exception and returns the error of the part."""
    path = _traceback_path(run, part)
    make_folder(path.parent)
    replace_file(path, "".join(traceback.format_exception(cause)).encode(errors="replace"))
    line = " ".join(traceback.format_exception_only(cause)[-1].split())
    return f"an unexpected error, {line[:300]}; its traceback is in {path}"


def _traceback_path(run: Path, part: str) -> Path:
    return run / TRACEBACKS / f"{quote(part, safe='')}.txt"
