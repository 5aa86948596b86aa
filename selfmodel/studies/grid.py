"""A grid of cells, computed by any executor and continued after any interruption."""

import asyncio
import math
import multiprocessing
import os
import signal
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent import futures
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from graphlib import TopologicalSorter
from multiprocessing import resource_tracker
from pathlib import Path
from time import perf_counter
from typing import ParamSpec, TypeVar

from selfmodel.errors import (
    InputError,
    WorkError,
    check_function,
    check_type,
    counted,
    whole_number,
)
from selfmodel.logs.files import make_folder
from selfmodel.progress import ignore
from selfmodel.studies import cells as cell_files
from selfmodel.studies.cells import (
    CELL,
    EARLIER,
    UNFINISHED,
    Answer,
    Cell,
    changed,
    difference,
    is_source,
    read_cell,
    versions_of,
)

ATTEMPTS = 2
"""Attempts to compute a cell whose process ends."""

CONNECT_SECONDS, PING_SECONDS = 30, 30
"""Longest wait for an answer of a cluster's scheduler, and time between two questions, s."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True)
class GridBegins:
    """Start of a grid: the number of all cells, and of those that need not be computed.

    ``earlier`` is a sentence on cells of an earlier source of a plug-in; "" without any.
    """

    total: int
    finished: int
    earlier: str = ""

    def __str__(self) -> str:
        done = f"{self.finished} of {self.total} were done before"
        return "; ".join(filter(None, (self.earlier, done)))


@dataclass(frozen=True)
class CellEnds:
    """End of a cell: its number of the total, its wall time, s, and the reason of a failure.

    ``rate`` is the number of cells per second so far. The text is a line with the time left.
    """

    name: str
    number: int
    total: int
    seconds: float
    error: str | None
    rate: float = 0.0

    def __str__(self) -> str:
        end = f"failed: {self.error}" if self.error else f"done in {self.seconds:.1f} s"
        line = f"[{self.number}/{self.total}] {self.name}: {end}"
        return "; ".join(filter(None, (line, self.pace)))

    @property
    def pace(self) -> str:
        """The rate and the time left as text; nothing at the end."""
        if not (self.rate and self.number < self.total):
            return ""
        minutes = math.ceil((self.total - self.number) / self.rate / 60)
        return f"{3600 * self.rate:.0f} an hour, {minutes // 60} h {minutes % 60:02d} min left"


def failures_text(failed: Sequence[CellEnds], again: str) -> str:
    """Returns a sentence on failed cells, at least one; ``again`` is what tries them again."""
    first, count = failed[0], f"{len(failed)} of {counted(failed[0].total, 'cell')}"
    return (
        f"{count} failed, the first of them {first.name}: {first.error}; {again} tries them again"
    )


def run_grid(
    folder: Path,
    cells: Sequence[Cell],
    *,
    executor: Executor | None = None,
    workers: int = 1,
    on_event: Callable[[GridBegins | CellEnds], None] = ignore,
    warns: bool = True,
) -> tuple[CellEnds, ...]:
    """Computes all cells that are not finished, and returns the failed ones.

    A failure is written into the folder ``errors``, an unexpected one with its traceback, and stops
    no cell that does not need the failed one. Where files cannot be written, as on a full disk, the
    grid ends. Cells of an earlier source of a plug-in are moved to the folder ``earlier``, and from
    there if that source is restored.

    Args:
        folder: Folder of the study, which all workers know by the same path.
        cells: The cells; those that they need are computed as well, once.
        executor: Executor whose workers can import selfmodel; None for processes of this machine.
        workers: Number of these processes.
        on_event: Called with the start of the grid and the end of every cell.
        warns: Whether Python warnings tell of failures, and of cells of an earlier source.

    Raises:
        InputError: A cell in the folder is damaged or of other code, or a worker has other code.
        OSError: The folder cannot be written; all finished cells are kept.
        WorkError: The executor ended; all finished cells are kept.
    """
    check_function("on_event", on_event)
    check_type(executor, Executor | None, "an Executor of concurrent.futures, or None")
    workers, every = whole_number("workers", workers, 2, least=1), _with_needs(cells)
    left, earlier = _unfinished(folder, cells, every)
    number = before = len(every) - len(left)
    if earlier and warns:
        warnings.warn(earlier, stacklevel=3)
    on_event(GridBegins(len(every), number, earlier))
    start = perf_counter()
    failures: list[CellEnds] = []
    if left:
        make_folder(folder)
        for cell, (seconds, error) in _computed(folder, left, executor, workers):
            number += 1
            rate = (number - before) / (perf_counter() - start)
            end = CellEnds(cell.name, number, len(every), seconds, error, rate)
            failures += [end] if error is not None else []
            on_event(end)
    with suppress(OSError):  # another command computes cells there
        (folder / UNFINISHED).rmdir()
    if failures and warns:
        warnings.warn(failures_text(failures, "the same call"), stacklevel=3)
    return tuple(failures)


def _with_needs(cells: Iterable[Cell]) -> dict[str, Cell]:
    """Returns cells and all that they need by their place, each once and after its needs."""
    ordered: dict[str, Cell] = {}
    for cell in cells:
        if cell.place not in ordered:
            ordered |= _with_needs(cell.needs.values())
            ordered[cell.place] = cell
    return ordered


def _unfinished(
    folder: Path, cells: Iterable[Cell], every: Mapping[str, Cell]
) -> tuple[dict[str, Cell], str]:
    """Returns the cells to compute by their place, and a sentence on cells of an earlier source.

    A needed cell that lacks files is among them.

    Raises:
        InputError: A cell in the folder is damaged, or was made by other code than this.
    """
    here, earlier, restored = versions_of(every.values()), Counter[str](), 0
    for place in every:
        if (folder / EARLIER / place / CELL).exists() and not (folder / place / CELL).exists():
            cell_files.move(folder, place, aside=False)
            restored += 1
    known: dict[str, cell_files.FinishedCell] = {}
    for path in sorted(folder.glob(f"*/*/{CELL}")):
        if path.parts[-3] == UNFINISHED:  # what a killed worker left
            continue
        cell, place = read_cell(path), path.parent.relative_to(folder).as_posix()
        names = changed(cell.made_with, here)
        if not all(map(is_source, names)):
            own, installed = difference(cell.made_with, {**cell.made_with, **here})
            raise InputError(
                f"{path.parent} was made with {own}, installed are {installed}: a study is of one "
                f"version of each; install those versions, or choose another folder"
            )
        if names:
            cell_files.move(folder, place, aside=True)
            earlier[", ".join(names)] += 1
        else:
            known[place] = cell
    places: set[str] = set()
    todo = [cell for cell in cells if cell.place not in known]
    while todo:
        place = (wanted := todo.pop()).place
        if place not in places and not (place in known and known[place].has_files):
            places.add(place)
            todo += wanted.needs.values()
    moved = [
        f"{counted(count, 'cell')} made by another {names}" for names, count in earlier.items()
    ]
    tells = [f"{' and '.join(moved)}: moved to {folder / EARLIER}"] if moved else []
    tells += [f"{counted(restored, 'cell')} of this source: used again from there"] * bool(restored)
    tells += ["those that this study lacks are computed again"] * bool(moved and places)
    return {place: every[place] for place in every if place in places}, "; ".join(tells)


def _computed(
    folder: Path, cells: Mapping[str, Cell], given: Executor | None, workers: int
) -> Iterator[tuple[Cell, Answer]]:
    """Yields each cell with its answer, in order of completion.

    A given executor gets every cell as soon as it can be computed, processes get the first cells
    first: an interrupted study has whole runs. A need that is not among the cells is finished.
    """
    graph = TopologicalSorter(
        {
            place: {need.place for need in cell.needs.values()} & cells.keys()
            for place, cell in cells.items()
        }
    )
    graph.prepare()
    limit = min(workers, len(cells)) if given is None else len(cells)
    rank = {place: number for number, place in enumerate(cells)}
    ready: list[str] = []
    running: dict[Future[Answer], str] = {}
    failed: set[str] = set()
    with _until_all_end(given, running) if given else Processes(limit) as executor:
        while graph.is_active():
            ready = sorted([*ready, *graph.get_ready()], key=rank.__getitem__)
            answers: dict[str, Answer] = {}
            while ready and len(running) < limit:
                cell = cells[place := ready.pop(0)]
                if lost := [need.name for need in cell.needs.values() if need.place in failed]:
                    answers[place] = 0.0, f"not computed: it needs {lost[0]}, which failed"
                else:
                    running[_submitted(executor, folder, cell)] = place
            if not answers:
                for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                    place = running.pop(future)
                    answers[place] = _answer(future, folder, place)
            for place, answer in answers.items():
                graph.done(place)
                failed |= set() if answer[1] is None else {place}
                yield cells[place], answer


@contextmanager
def _until_all_end(executor: Executor, running: Iterable["Future[Answer]"]) -> Iterator[Executor]:
    """Context manager that waits for cells that have begun: they would write into the folder later.

    A call on a cluster is cancelled instead.
    """
    try:
        yield executor
    finally:
        futures.wait([future for future in running if not future.cancel()])


def _submitted(executor: Executor, folder: Path, cell: Cell) -> "Future[Answer]":
    try:
        return executor.submit(cell_files.compute, folder, cell, cell.made_with())
    except RuntimeError as error:  # of an executor that has ended
        raise WorkError(
            f"the executor takes no more cells ({error}): finished cells are kept; the same "
            f"command continues"
        ) from error


def _answer(future: "Future[Answer]", folder: Path, place: str) -> Answer:
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
    reason = f"the executor failed to compute it: {line}"
    cell_files.keep_error(folder, place, reason)
    return 0.0, reason


class Processes(Executor):
    """Processes of this machine; a call whose process ends is repeated once, in a new one.

    The processes end with the ``with`` block.
    """

    def __init__(self, workers: int) -> None:
        self._threads, self._of_thread = ThreadPoolExecutor(workers), threading.local()
        self._pools: list[ProcessPoolExecutor] = []
        self._others = set(multiprocessing.active_children())
        self._has_ended, self._starts = False, threading.Lock()

    def __exit__(self, *_: object) -> None:
        with self._starts:
            self._has_ended = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - self._others:
            process.kill()  # a cell may take minutes, and its result would not be wanted
        self._threads.shutdown()
        for pool in self._pools:  # Python's exit writes to the pipe of one that is still closing
            pool.shutdown()

    def submit(
        self, call: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs
    ) -> "Future[_T]":
        """Calls a function in one of the processes."""
        return self._threads.submit(lambda: self._call(call, *args, **kwargs))

    def _call(self, call: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
        reason: object = None
        for _ in range(ATTEMPTS):
            with self._starts:  # none starts after the others were killed
                if self._has_ended:
                    break
                if not hasattr(self._of_thread, "pool"):
                    self._of_thread.pool = _one_process()
                    self._pools.append(self._of_thread.pool)
                future: Future[_T] = self._of_thread.pool.submit(call, *args, **kwargs)
            try:
                return future.result()
            except futures.BrokenExecutor as error:
                reason = error
                del self._of_thread.pool
        raise futures.BrokenExecutor(f"its process ended in each of {ATTEMPTS} attempts: {reason}")


def _one_process() -> ProcessPoolExecutor:
    """Returns an executor of one process.

    Python's resource tracker, which it needs, must not end with the terminal, by SIGHUP: started
    again, it prints a traceback for each semaphore that it does not know.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin_worker)


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


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yields the workers of a running Dask cluster.

    Args:
        address: ``HOST:PORT`` of the scheduler, or ``tls://HOST:PORT`` for a connection that Dask's
            configuration encrypts.
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
        with limits, ThreadPoolExecutor(1) as thread:  # a notebook has an event loop in this thread
            thread.submit(asyncio.run, greet()).result()
            client = Client(place, timeout=CONNECT_SECONDS)
    except (OSError, ValueError, RuntimeError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise InputError(
            f"no Dask scheduler answers at {address} ({reason}): start one with `dask scheduler`, "
            f"and workers with `dask worker`, or correct the address"
        ) from error
    ended = threading.Event()

    def watch() -> None:
        """Closes the client of a mute scheduler, which cancels all calls: TCP alone would wait."""
        while not ended.wait(PING_SECONDS):
            try:
                client.sync(client.scheduler.identity, callback_timeout=CONNECT_SECONDS)  # type: ignore[union-attr]  # connected
            except OSError:
                client.close()
                return

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    try:
        # A pure call of the same arguments would be answered with the error of the last one.
        yield client.get_executor(pure=False)
    finally:
        ended.set()
        watching.join()  # two calls of close at a time would mix
        client.close()
