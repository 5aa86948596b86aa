"""Pool of worker processes that run chains of tasks and report the exit of a worker per task.

``concurrent.futures.ProcessPoolExecutor`` is no substitute: one worker that exits fails all tasks
of its pool, without the exit status, and a running task cannot be terminated before Python 3.14.
"""

import multiprocessing
import os
import signal
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar

from selfmodel.physical.stop_signals import STOP_SIGNALS, hold_stop_signals

Task = TypeVar("Task")
Answer = TypeVar("Answer")

MAX_TASKS_PER_WORKER = 100
"""Tasks after which a process begins no further chain, so that its memory stays bounded."""


@dataclass(frozen=True)
class WorkerExit:
    """Result of a task whose process exited.

    Attributes:
        status: Exit status; minus the number of the signal that ended the process.
    """

    status: int


def run_tasks(
    perform: Callable[[Task], Answer], chains: Sequence[Sequence[Task]], workers: int
) -> Generator[tuple[Task, Answer | WorkerExit], None, None]:
    """Runs tasks in worker processes and yields each with its result, in order of completion.

    A process that exits fails its current task and is replaced by another process. Workers never
    receive Ctrl-C, SIGTERM or SIGHUP, which a terminal or ``timeout`` send to them as well; closing
    the generator kills all of them.

    Args:
        perform: Function that runs one task. It must be importable; an exception ends its process.
        chains: Tasks to run one after another, in order; chains run side by side, the first ones
            first.
        workers: Number of processes at a time, at least 1.
    """
    waiting = deque(chain for chain in chains if chain)
    with _pool() as spawn:
        idle: list[_Worker] = []
        busy: dict[Connection, _Worker] = {}
        while waiting or busy:
            while waiting and len(busy) < workers:
                idle = [worker for worker in idle if worker.process.is_alive()]
                worker = idle.pop() if idle else spawn(perform)
                worker.begin(waiting.popleft())
                busy[worker.pipe] = worker
            ready = wait(list(busy))
            for pipe in [pipe for pipe in busy if pipe in ready]:
                worker = busy.pop(pipe)
                task, answer = worker.finish()
                if isinstance(answer, WorkerExit) or worker.tasks >= MAX_TASKS_PER_WORKER:
                    pipe.close()  # a worker without its pipe exits
                else:
                    idle.append(worker)
                if worker.chain:
                    waiting.appendleft(worker.chain)
                yield task, answer


@dataclass(eq=False)
class _Worker:
    """Worker process with the rest of its chain.

    Attributes:
        process: The process.
        pipe: Connection to the process.
        chain: Tasks left, the current one first.
        tasks: Number of tasks that the process has finished.
    """

    process: SpawnProcess
    pipe: Connection
    chain: deque[Any]
    tasks: int = 0

    def begin(self, chain: Sequence[Any]) -> None:
        """Sends the first task of a chain."""
        self.chain = deque(chain)
        with suppress(ConnectionError):  # the process has exited; ``finish`` returns its status
            self.pipe.send(self.chain[0])

    def finish(self) -> tuple[Any, Any]:
        """Returns the current task and its result, and removes the task from the chain."""
        task = self.chain.popleft()
        self.tasks += 1
        try:
            return task, self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.join()
            return task, WorkerExit(self.process.exitcode or 0)


@contextmanager
def _pool() -> Iterator[Callable[[Callable[..., Any]], _Worker]]:
    """Context manager with a function that starts a worker; kills all workers at its end."""
    context = multiprocessing.get_context("spawn")
    started: list[_Worker] = []

    def spawn(perform: Callable[..., Any]) -> _Worker:
        pipe, worker_end = context.Pipe()
        process = context.Process(target=_serve, args=(perform, worker_end), daemon=True)
        with hold_stop_signals():  # a process that has started is in the list
            with _stop_signals_blocked():
                process.start()
            started.append(_Worker(process, pipe, deque()))
        worker_end.close()  # a pipe with one open end reports EOF when the process exits
        return started[-1]

    try:
        yield spawn
    finally:
        for worker in started:
            worker.process.kill()  # SIGTERM is blocked
        for worker in started:
            worker.process.join()
            worker.pipe.close()


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


def _serve(perform: Callable[..., Any], pipe: Connection) -> None:
    """Main function of a worker: runs the tasks from a pipe until the pipe is closed."""
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    os.dup2(2, 1)  # standard output is for the results of the command
    # A result contains whether a simulation diverged; a worker's raw text does not name the task.
    warnings.simplefilter("ignore", RuntimeWarning)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, ConnectionError):
            return
        answer = perform(task)
        try:
            pipe.send(answer)
        except ConnectionError:  # the command was killed meanwhile
            return


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
