"""Executor of worker processes on this machine, each of which may exit without harm to the others.

``concurrent.futures.ProcessPoolExecutor`` is no substitute: one worker that exits fails all calls
of its pool, without the exit status, and a running call cannot be ended before Python 3.14.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar

from selfmodel.experiments.grid.workers import Workers
from selfmodel.physical.safety import STOP_SIGNALS

Answer = TypeVar("Answer")

MAX_CALLS_PER_WORKER = 100
"""Calls after which a process is replaced, so that its memory stays bounded."""


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """Yields worker processes on this machine.

    Args:
        count: Number of processes, at least 1.
    """
    with ProcessWorkers(count) as executor:
        yield Workers(executor, count)


class WorkerExitError(BrokenExecutor):
    """The worker process of a call exited.

    Args:
        status: Exit status; minus the number of the signal that ended the process.
    """

    def __init__(self, status: int) -> None:
        super().__init__(f"its process ended with status {status}")
        self.status = status


class ProcessWorkers(Executor):
    """Executor of a number of processes, started when they are needed.

    A process that exits fails its own call with ``WorkerExitError``. Workers never receive Ctrl-C,
    SIGTERM or SIGHUP, which a terminal or ``timeout`` send to them as well; ``shutdown`` kills
    them.

    Args:
        workers: Number of processes at a time, at least 1.
    """

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)  # each waits for one process
        self._lock = threading.Lock()
        self._all: list[_Worker] = []
        self._idle: list[_Worker] = []
        self._closed = False

    def submit(
        self,
        fn: Callable[..., Answer],
        /,
        *args: Any,  # noqa: ANN401  # of any function
        **kwargs: Any,  # noqa: ANN401
    ) -> "Future[Answer]":
        """Calls an importable function, which must not raise, in a worker process."""
        return self._threads.submit(self._call, (fn, args, kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:  # noqa: FBT001, FBT002  # as in Executor
        """Kills all workers; calls that run or wait end with an error or are cancelled."""
        with self._lock:
            self._closed = True
        for worker in self._all:
            worker.process.kill()  # SIGTERM is blocked
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)
        for worker in self._all:
            worker.process.join()
            worker.pipe.close()

    def _call(self, call: tuple[Any, ...]) -> Any:  # noqa: ANN401  # of any function
        with self._lock:
            self._idle = [worker for worker in self._idle if worker.process.is_alive()]
            worker = self._idle.pop() if self._idle else self._spawn()
        answer = worker.call(call)
        with self._lock:
            if worker.calls < MAX_CALLS_PER_WORKER:
                self._idle.append(worker)
            else:
                worker.pipe.close()  # a worker without its pipe exits
        return answer

    def _spawn(self) -> "_Worker":
        if self._closed:
            raise WorkerExitError(-signal.SIGKILL)
        self._all = [worker for worker in self._all if worker.process.is_alive()]
        context = multiprocessing.get_context("spawn")
        pipe, worker_end = context.Pipe()
        process = context.Process(target=_serve, args=(worker_end,), daemon=True)
        with _stop_signals_blocked():
            process.start()
        worker_end.close()  # a pipe with one open end reports EOF when the process exits
        self._all.append(_Worker(process, pipe))
        return self._all[-1]


class _Worker:
    """Worker process with its pipe.

    Args:
        process: The process.
        pipe: Connection to the process.

    Attributes:
        calls: Number of calls that the process has answered.
    """

    def __init__(self, process: SpawnProcess, pipe: Connection) -> None:
        self.process = process
        self.pipe = pipe
        self.calls = 0

    def call(self, call: tuple[Any, ...]) -> Any:  # noqa: ANN401  # of any function
        """Makes a call and returns its answer.

        Raises:
            WorkerExitError: The process exited.
        """
        try:
            self.pipe.send(call)
            answer = self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.join()
            raise WorkerExitError(self.process.exitcode or 0) from None
        self.calls += 1
        return answer


@contextmanager
def _stop_signals_blocked() -> Iterator[None]:
    """Context manager that blocks the stop signals, also in the processes that it starts."""
    # The first process starts the tracker, which would unblock the signals.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(pipe: Connection) -> None:
    """Main function of a worker: answers the calls from a pipe until the pipe is closed."""
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    os.dup2(2, 1)  # standard output is for the results of the command
    while True:
        try:
            function, args, kwargs = pipe.recv()
        except (EOFError, ConnectionError):
            return
        answer = function(*args, **kwargs)
        try:
            pipe.send(answer)
        except ConnectionError:  # the command was killed meanwhile
            return


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
