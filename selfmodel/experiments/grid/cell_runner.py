"""Computation of one cell in a worker: beside its place, then moved there as a whole."""

import errno
import importlib
import shutil
import socket
import time
import traceback
import uuid
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from selfmodel.errors import InputError, WorkError
from selfmodel.experiments.grid.cell import Cell, Work
from selfmodel.experiments.grid.cell_file import (
    CELL,
    FinishedPart,
    cell_bytes,
    has_files,
    read_cell,
)
from selfmodel.experiments.grid.checks import refused_versions
from selfmodel.files import sync_folder
from selfmodel.logs import result_files
from selfmodel.logs.errors import is_full
from selfmodel.logs.files import make_folder, not_written, replace_file

UNFINISHED = "unfinished"
"""Folder of the cells that are being computed; those of killed workers may be deleted."""

ERRORS = "errors"
"""Folder of the errors of the cells that failed."""

FILE_SYSTEM_SECONDS = 30.0
"""Longest wait for a cell that another machine has finished: network file systems show it late."""


class Outcome(Enum):
    """End of a cell.

    Attributes:
        DONE: The cell is finished.
        FAILED: The cell failed; the others go on.
        SKIPPED: A cell that it needs failed.
        LOST: Its worker exited repeatedly, or the executor failed.
        NOT_WRITTEN: The disk is full or not writable: the other cells would fail too.
        REFUSED: The worker has other versions than the command.
    """

    DONE = "done"
    FAILED = "failed"
    SKIPPED = "skipped"
    LOST = "lost"
    NOT_WRITTEN = "not written"
    REFUSED = "refused"


@dataclass(frozen=True)
class CellAnswer:
    """End of a cell, as its worker reports it.

    Attributes:
        outcome: The end.
        seconds: Wall time, s.
        error: Reason of any other outcome than ``DONE``.
    """

    outcome: Outcome
    seconds: float
    error: str | None = None


def run_cell(folder: Path, cell: Cell, place: str, versions: Mapping[str, str]) -> CellAnswer:
    """Computes a cell, unless it is finished meanwhile, and returns how that ended.

    Args:
        folder: Folder of the study, the same on all machines.
        cell: The cell.
        place: Its folder in that of the study.
        versions: Versions of the command.
    """
    own = result_files.versions()
    if own != versions:
        refusal = refused_versions(f"the worker on {socket.gethostname()}", own, versions)
        return CellAnswer(Outcome.REFUSED, 0.0, refusal)
    start = time.perf_counter()
    try:
        error = _compute(folder, cell, place)
        seconds = time.perf_counter() - start
        return CellAnswer(Outcome.FAILED if error else Outcome.DONE, seconds, error)
    except InputError as cause:  # the finished cell was damaged or altered meanwhile
        return CellAnswer(Outcome.FAILED, time.perf_counter() - start, str(cause))
    except OSError as cause:
        return CellAnswer(Outcome.NOT_WRITTEN, time.perf_counter() - start, str(cause))


def error_path(folder: Path, place: str) -> Path:
    """Returns the file of the error of a cell that failed."""
    return folder / ERRORS / f"{Path(place).name}.txt"


def write_error(folder: Path, place: str, text: str) -> Path:
    """Writes the error of a cell and returns its file."""
    path = error_path(folder, place)
    make_folder(path.parent)
    replace_file(path, f"{text}\n".encode(errors="replace"))
    return path


def _compute(folder: Path, cell: Cell, place: str) -> str | None:
    """Computes a cell and returns the reason of its failure.

    Raises:
        InputError: The finished cell is damaged or altered.
        OSError: The disk is full or not writable.
    """
    if _is_complete(folder / place):
        return None
    unfinished = folder / UNFINISHED / f"{place}.{uuid.uuid4().hex[:8]}"
    try:
        return _compute_in(unfinished, folder, cell, place)
    except OSError:
        if _is_complete(folder / place):  # another worker finished it, and removed what is left
            return None
        raise
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _compute_in(unfinished: Path, folder: Path, cell: Cell, place: str) -> str | None:
    """Computes a cell in a new folder, moves that to its place, and returns any failure.

    Raises:
        InputError: The finished cell is damaged or altered.
        OSError: The disk is full or not writable.
    """
    make_folder(unfinished)
    made = _perform(folder, cell, unfinished)
    if isinstance(made, bytes):
        replace_file(unfinished / CELL, made)
        _publish(unfinished, folder / place)
        error_path(folder, place).unlink(missing_ok=True)  # of an earlier failure
        for left in unfinished.parent.glob(f"{Path(place).name}.*"):  # of killed workers
            shutil.rmtree(left, ignore_errors=True)
        return None
    if _is_complete(folder / place):
        return None
    path = write_error(folder, place, made.text)
    return f"{made.error}; its traceback is in {path}" if made.unexpected else made.error


@dataclass(frozen=True)
class _Failure:
    """Failure of a cell.

    Attributes:
        error: The reason in a line.
        text: Content of the file of the error.
        unexpected: Whether no one foresaw it, so that the file has a traceback.
    """

    error: str
    text: str
    unexpected: bool = False


def _perform(folder: Path, cell: Cell, own: Path) -> bytes | _Failure:
    """Calls the function of a cell and returns its ``cell.json``, or the failure.

    Raises:
        OSError: The disk is full.
    """
    start = time.perf_counter()
    try:
        needs = {name: _finished_cell(folder / one.place) for name, one in cell.needs.items()}
        with warnings.catch_warnings():
            # A result contains whether a simulation diverged; raw text does not name the cell.
            warnings.simplefilter("ignore", RuntimeWarning)
            paths = {name: part.path.parent for name, part in needs.items()}
            result = _work(cell.function)(cell, paths, own)
        return cell_bytes(own, cell, result, time.perf_counter() - start, needs)
    except OSError as cause:
        if is_full(cause):
            raise not_written(cause.filename or own, cause) from cause
        error = str(cause) or type(cause).__name__
    except (InputError, WorkError, MemoryError) as cause:
        error = str(cause) or type(cause).__name__
    except Exception as cause:  # noqa: BLE001  # a plug-in may raise any exception
        line = " ".join(traceback.format_exception_only(cause)[-1].split())
        text = "".join(traceback.format_exception(cause))
        return _Failure(f"an unexpected error, {line[:300]}", text, unexpected=True)
    return _Failure(error, error)


def _work(function: str) -> Work:
    """Returns the function of a cell, which a plan names as ``package.module:function``."""
    module, _, name = function.partition(":")
    work: Work = getattr(importlib.import_module(module), name)
    return work


def _finished_cell(folder: Path) -> FinishedPart:
    """Returns a cell that is needed, with all its files.

    Raises:
        InputError: It is damaged, or some of its files are missing.
    """
    deadline = time.monotonic() + FILE_SYSTEM_SECONDS
    while not (folder / CELL).exists() and time.monotonic() < deadline:
        time.sleep(0.2)
    part = read_cell(folder / CELL, {})
    if not has_files(part):
        raise InputError(f"{folder} lacks files of its cell: run the same command again")
    return part


def _is_complete(folder: Path) -> bool:
    return (folder / CELL).exists() and has_files(read_cell(folder / CELL, {}))


def _publish(unfinished: Path, place: Path) -> None:
    """Moves the folder of a cell to its place; of two workers, the first one keeps it."""
    make_folder(place.parent)
    try:
        unfinished.rename(place)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise not_written(place, error) from error
        if _is_complete(place):
            return
        aside = unfinished.with_name(f"{unfinished.name}.old")
        place.rename(aside)  # a cell without its result, or without files that are needed again
        unfinished.rename(place)
        shutil.rmtree(aside, ignore_errors=True)
    sync_folder(place.parent)
