"""A grid of cells, computed by any executor and continued after any interruption."""

import asyncio
import multiprocessing
import os
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from graphlib import TopologicalSorter
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Self

from selfmodel.errors import InputError, WorkError
from selfmodel.logs.files import make_folder
from selfmodel.studies.cells import (
    CELL,
    UNFINISHED,
    Cell,
    FinishedCell,
    compute,
    keep_error,
    listed,
    made_with,
    read_cell,
)

AT_ONCE = 1000
"""Cells that are submitted at a time to an executor of the caller: more than a cluster has workers,
some of which come later."""

ATTEMPTS = 2
"""Attempts to compute a cell whose process exits; in the last one it is alone."""

CONNECT_SECONDS = 30
"""Longest wait for the scheduler of a cluster, s."""

Answer = tuple[float, str | None]
"""Wall time of a cell, s, and the reason of its failure."""


@dataclass(frozen=True)
class GridBegins:
    """Start or continuation of a grid.

    Attributes:
        total: Number of cells, with those that others need.
        finished: Number of cells that were finished before, or that no other cell needs any more.
    """

    total: int
    finished: int


@dataclass(frozen=True)
class CellEnds:
    """End of a cell.

    Attributes:
        name: Name of the cell.
        number: Number of cells that have finished or failed so far.
        total: Number of cells.
        seconds: Wall time of the cell.
        error: Reason of a failure; None for a finished cell.
    """

    name: str
    number: int
    total: int
    seconds: float
    error: str | None


def run_grid(
    folder: Path,
    cells: Sequence[Cell],
    *,
    executor: Executor | None = None,
    workers: int = 1,
    on_progress: Callable[[GridBegins | CellEnds], None] = lambda _event: None,
) -> tuple[CellEnds, ...]:
    """Computes all cells that are not finished, and returns the failed ones.

    A failure is written into the folder ``errors``, an unexpected one with its traceback, and stops
    no cell that does not need the failed one. Where files cannot be written, as on a full disk, the
    grid ends.

    Args:
        folder: Folder of the study, which all workers know by the same path.
        cells: The cells; those that they need are computed as well, once.
        executor: Executor whose workers can import selfmodel; None for processes of this machine.
        workers: Number of these processes.
        on_progress: Callback for the start of the grid and for every cell that ends.

    Raises:
        InputError: A cell in the folder is damaged or of other code, or a worker has other code.
        OSError: The folder cannot be written; all finished cells are kept.
        WorkError: The executor ended; all finished cells are kept.
    """
    wanted = _with_needs(cells)
    left = _unfinished(cells, _finished_here(folder, wanted.values()))
    total, number = len(wanted), len(wanted) - len(left)
    on_progress(GridBegins(total, number))
    failures: list[CellEnds] = []
    if left:
        make_folder(folder)
    ordered = {place: cell for place, cell in wanted.items() if place in left}
    for cell, (seconds, error) in _computed(folder, ordered, executor, workers):
        number += 1
        end = CellEnds(cell.name, number, total, seconds, error)
        failures += [end] if error is not None else []
        on_progress(end)
    for empty in (*(folder / UNFINISHED).glob("*"), folder / UNFINISHED):
        with suppress(OSError):  # another command computes cells there
            empty.rmdir()
    return tuple(failures)


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yields the workers of a running Dask cluster.

    Args:
        address: ``HOST:PORT`` of the scheduler, or ``tls://HOST:PORT`` for a connection that Dask's
            configuration encrypts.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    try:
        import dask  # noqa: PLC0415  # an extra
        from distributed import Client, Security  # noqa: PLC0415  # an extra
        from distributed.comm.core import connect  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise InputError(
            "a Dask cluster needs the package distributed: pip install 'selfmodel[dask]'"
        ) from error
    place = address if "://" in address else f"tcp://{address}"

    async def greet() -> None:
        """Connects once: a client waits without a limit for a server that accepts and is mute."""
        options = Security().get_connection_args("client")
        async with asyncio.timeout(CONNECT_SECONDS):
            comm = await connect(place, timeout=CONNECT_SECONDS, **options)
            await comm.close()

    # The connection itself has a timeout of its own, and is tried until that of the client ends.
    limits = dask.config.set({"distributed.comm.timeouts.connect": f"{CONNECT_SECONDS}s"})
    try:
        with limits, ThreadPoolExecutor(1) as own:  # a notebook has an event loop in this thread
            own.submit(asyncio.run, greet()).result()
            client = Client(place, timeout=CONNECT_SECONDS)
    except (OSError, ValueError, RuntimeError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise InputError(
            f"no Dask scheduler answers at {address} ({reason}): start one with `dask scheduler`, "
            f"and workers with `dask worker`, or correct the address"
        ) from error
    with client:
        # A pure call of the same arguments would be answered with the error of the last one.
        yield client.get_executor(pure=False)


def _with_needs(cells: Iterable[Cell]) -> dict[str, Cell]:
    """Returns cells and all that they need by their place, each once and after its needs."""
    found: dict[str, Cell] = {}
    for cell in cells:
        if cell.place not in found:
            found |= _with_needs(cell.needs.values())
            found[cell.place] = cell
    return found


def _finished_here(folder: Path, wanted: Iterable[Cell]) -> dict[str, FinishedCell]:
    """Returns the finished cells in the folder of a study by their place.

    Raises:
        InputError: A cell is damaged, or was made by other code than this.
    """
    made = [dict(made_with(function)) for function in {cell.function for cell in wanted}]
    found: dict[str, FinishedCell] = {}
    for path in sorted(folder.glob(f"*/*/{CELL}")):
        cell = read_cell(path)
        if made and cell.made_with not in made:
            raise InputError(
                f"{path.parent} was made with {listed(cell.made_with)}, installed are "
                f"{listed(made[0])}: a study is of one version of each; install those versions, "
                f"or choose another folder"
            )
        found[path.parent.relative_to(folder).as_posix()] = cell
    return found


def _unfinished(cells: Iterable[Cell], known: Mapping[str, FinishedCell]) -> set[str]:
    """Returns the places of the cells to compute.

    A cell that only finished ones need is not computed; one that others need, and that lacks files,
    is.
    """
    left: set[str] = set()
    todo = [cell for cell in cells if cell.place not in known]
    while todo:
        cell = todo.pop()
        is_there = cell.place in known and known[cell.place].has_files
        if not is_there and cell.place not in left:
            left.add(cell.place)
            todo += cell.needs.values()
    return left


def _computed(
    folder: Path, cells: Mapping[str, Cell], given: Executor | None, workers: int
) -> Iterator[tuple[Cell, Answer]]:
    """Yields each cell with its answer, in order of completion.

    Args:
        folder: Folder of the study.
        cells: The cells to compute by their place, each after those that it needs; a need that is
            not among them is finished.
        given: Executor of the caller; None for processes.
        workers: Number of the processes.
    """
    places = list(cells)
    graph = TopologicalSorter(
        {
            place: {need.place for need in cell.needs.values()} & cells.keys()
            for place, cell in cells.items()
        }
    )
    graph.prepare()
    number = {place: rank for rank, place in enumerate(places)}
    ready: list[int] = []  # first cells first, so that an interrupted study has whole runs
    alone: list[str] = []
    running: dict[Future[Answer], str] = {}
    exits: Counter[str] = Counter()
    failed: set[str] = set()
    with _Pool(given, min(workers, len(cells))) as pool:
        while graph.is_active():
            ready = sorted([*ready, *map(number.__getitem__, graph.get_ready())])
            answers: dict[str, Answer] = {}
            while ready and len(running) < pool.at_once:
                place = places[ready.pop(0)]
                needs = [need for need in cells[place].needs.values() if need.place in failed]
                if needs:
                    reason = f"not computed: it needs {needs[0].name}, which failed"
                    answers[place] = 0.0, reason
                    continue
                running[pool.submit(folder, cells[place])] = place
            if alone and not running:
                place = alone.pop(0)
                running[pool.submit(folder, cells[place])] = place
            for future in wait(running, return_when=FIRST_COMPLETED).done if not answers else ():
                if pool.is_broken_by(future):  # and with it are all other calls
                    exits.update(running.values())
                    alone += [place for place in running.values() if exits[place] < ATTEMPTS]
                    answers |= {
                        place: _crashed(future, folder, place)
                        for place in running.values()
                        if exits[place] == ATTEMPTS
                    }
                    running.clear()
                    break
                place = running.pop(future)
                answers[place] = _answer(future, folder, place)
            for place, answer in answers.items():
                graph.done(place)
                failed |= set() if answer[1] is None else {place}
                yield cells[place], answer


def _crashed(future: "Future[Answer]", folder: Path, place: str) -> Answer:
    reason = f"its process ended in each of {ATTEMPTS} attempts: {future.exception()}"
    return 0.0, keep_error(folder, place, reason)


def _answer(future: "Future[Answer]", folder: Path, place: str) -> Answer:
    """Returns the answer of a call that has ended.

    Raises:
        InputError: The worker has other code than the command.
        OSError: The worker cannot write into the folder.
        WorkError: The executor has ended.
    """
    if future.cancelled():
        raise WorkError(
            "the executor has ended, such as the scheduler of a cluster: finished cells are kept; "
            "start it, and the same command continues"
        )
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, InputError | OSError):
        raise error
    line = " ".join(f"{type(error).__name__}: {error}".split())[:1000]
    if isinstance(error, ImportError):
        raise InputError(
            f"a worker cannot import what computes a cell ({line}): install the same version of "
            f"selfmodel there as here"
        ) from error
    return 0.0, keep_error(folder, place, f"the executor failed to compute it: {line}")


class _Pool:
    """Processes, replaced when one exits, or the executor of the caller.

    Attributes:
        at_once: Number of cells to submit at a time.
    """

    def __init__(self, given: Executor | None, workers: int) -> None:
        self._given, self._workers, self._pool = given, workers, given
        self.at_once = workers if given is None else AT_ONCE
        self._others = set(multiprocessing.active_children())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_error: object) -> None:
        if self._given is not None or self._pool is None:
            return
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - self._others:
            process.kill()  # a cell may take minutes, and its result would not be wanted

    def submit(self, folder: Path, cell: Cell) -> "Future[Answer]":
        if self._pool is None:
            _start_resource_tracker()
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(self._workers, context, _begin_worker)
        try:
            return self._pool.submit(compute, folder, cell, dict(made_with(cell.function)))
        except RuntimeError as error:  # of an executor that has ended
            raise WorkError(
                f"the executor takes no more cells ({error}): finished cells are kept; the same "
                f"command continues"
            ) from error

    def is_broken_by(self, future: "Future[Answer]") -> bool:
        """Returns whether a process of the pool exited; a new pool then takes its place."""
        if self._given is not None or future.cancelled():
            return False
        if not isinstance(future.exception(), BrokenExecutor):
            return False
        self._pool = None
        return True


def _start_resource_tracker() -> None:
    """Starts Python's resource tracker so that a terminal that closes does not end it.

    It ignores SIGINT and SIGTERM by itself; ended by SIGHUP, it is started again, and prints a
    traceback for each semaphore that it does not know.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _begin_worker() -> None:
    """Prepares a worker process, which ends with the command, and by nothing else."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to workers as well
    os.dup2(2, 1)  # standard output is for the results of the command
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
