"""A study as a grid of cells, computed by any executor, resumable after any interruption.

The grid is independent of robots. Nothing but the finished cells is kept: the same call continues a
killed study, with the same executor or another, and tries the cells that failed again.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.experiments.grid.cell import Cell, with_needs
from selfmodel.experiments.grid.cell_file import FinishedPart, has_files
from selfmodel.experiments.grid.cell_runner import (
    UNFINISHED,
    CellAnswer,
    Outcome,
    run_cell,
    write_error,
)
from selfmodel.experiments.grid.checks import read_study
from selfmodel.experiments.grid.schedule import compute
from selfmodel.experiments.grid.workers import OpenWorkers
from selfmodel.logs import result_files
from selfmodel.logs.files import make_folder


@dataclass(frozen=True)
class GridBegins:
    """Start or resumption of a grid.

    Attributes:
        total: Number of cells, with those that others need.
        finished: Number of cells that were finished before, or that no other cell needs any more.
    """

    total: int
    finished: int


@dataclass(frozen=True)
class PartEnds:
    """End of a cell.

    Attributes:
        key: Key of its run.
        part: Name of the cell among those of its run.
        number: Number of cells that have finished or failed so far.
        total: Number of cells.
        seconds: Wall time of the cell.
        error: Reason of a failure; None for a finished cell.
    """

    key: str
    part: str
    number: int
    total: int
    seconds: float
    error: str | None


def run_grid(
    folder: Path,
    cells: Sequence[Cell],
    *,
    workers: OpenWorkers,
    on_progress: Callable[[GridBegins | PartEnds], None],
) -> tuple[PartEnds, ...]:
    """Computes all cells that are not finished, and returns the failed ones.

    The failure of a cell is in the folder ``errors``, an unexpected one with its traceback, and
    stops no cell that does not need it. If files cannot be written, such as on a full disk, the
    grid ends: the other cells would fail too.

    Args:
        folder: Folder of the study, which all workers know by the same path.
        cells: The cells; those that they need are computed as well, once.
        workers: The workers, started if a cell is not finished.
        on_progress: Callback for the start of the grid and for every cell that ends.

    Raises:
        InputError: A cell in the folder has other versions, or is damaged or altered, and no cell
            has been computed; or a worker has other versions.
        OSError: The folder cannot be written; all finished cells are kept.
        WorkError: The executor ended; all finished cells are kept.
    """
    wanted = with_needs(cells)
    left = _unfinished(cells, read_study(folder))
    total, before = len(wanted), len(wanted) - len(left)
    on_progress(GridBegins(total, before))
    failures: list[PartEnds] = []
    if not left:
        return ()
    make_folder(folder)
    with workers as given:
        submit = partial(_submit, given.executor, folder)
        in_order = {place: cell for place, cell in wanted.items() if place in left}
        ends = compute(in_order, submit, given)
        for number, (cell, answer) in enumerate(ends, start=before + 1):
            _check(folder, cell, answer)
            end = PartEnds(cell.key, cell.part, number, total, answer.seconds, answer.error)
            if end.error is not None:
                failures.append(end)
            on_progress(end)
    for empty in (*(folder / UNFINISHED).glob("*"), folder / UNFINISHED):
        with suppress(OSError):  # another command computes cells there
            empty.rmdir()
    return tuple(failures)


def _submit(executor: Executor, folder: Path, cell: Cell) -> "Future[CellAnswer]":
    return executor.submit(run_cell, folder, cell, cell.place, dict(result_files.versions()))


def _unfinished(cells: Iterable[Cell], found: Mapping[str, FinishedPart]) -> dict[str, Cell]:
    """Returns the cells that have to be computed, by place.

    A cell that only finished ones need is not computed; one that others need, and that lacks files,
    is.
    """
    left: dict[str, Cell] = {}

    def add(cell: Cell) -> None:
        if cell.place in left:
            return
        left[cell.place] = cell
        for need in cell.needs.values():
            if need.place not in found or not has_files(found[need.place]):
                add(need)

    for cell in cells:
        if cell.place not in found:
            add(cell)
    return left


def _check(folder: Path, cell: Cell, answer: CellAnswer) -> None:
    """Keeps the error of a lost worker, and raises that of an end which ends the grid."""
    match answer.outcome:
        case Outcome.LOST:
            write_error(folder, cell.place, str(answer.error))
        case Outcome.NOT_WRITTEN:
            raise OSError(answer.error)
        case Outcome.REFUSED:
            raise InputError(answer.error)
