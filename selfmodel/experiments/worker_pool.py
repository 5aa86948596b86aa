"""Work on several processors: processes that take chains of tasks, and may die of one.

A task is done by a function in a process of its own kind, started afresh (``spawn``): nothing is
shared but what the task says. A process that dies, of a bug, a crash in native code or a lack of
memory, costs the task that it was at; another takes its place.
"""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar

Task = TypeVar("Task")
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Died:
    """The process that was at a task ended.

    Attributes:
        status: Its exit status; minus the number of the signal, where one ended it.
    """

    status: int


def work_off(
    perform: Callable[[Task], Answer], chains: Sequence[Sequence[Task]], workers: int
) -> Generator[tuple[Task, Answer | Died], None, None]:
    """Does all tasks, and gives each with what came of it as soon as it is done.

    Ctrl-C reaches only this process; when the iterator is closed, all others are ended.

    Args:
        perform: Does one task; it can be imported, and raises only where there is a bug.
        chains: Tasks that are done one after another, in their order; chains run side by side,
            the first ones first.
        workers: Processes at a time, at least 1.
    """
    waiting = deque(chain for chain in chains if chain)
    with _crew() as hire:
        idle: list[_Worker] = []
        busy: dict[Connection, _Worker] = {}
        while waiting or busy:
            while waiting and len(busy) < workers:
                worker = idle.pop() if idle else hire(perform)
                worker.begin(waiting.popleft())
                busy[worker.pipe] = worker
            ready = wait(list(busy))
            for pipe in [pipe for pipe in busy if pipe in ready]:
                worker = busy.pop(pipe)
                task = worker.chain.popleft()
                answer = worker.answer()
                if not isinstance(answer, Died):
                    idle.append(worker)
                if worker.chain:
                    waiting.appendleft(worker.chain)
                yield task, answer


@dataclass(eq=False)
class _Worker:
    """A process, and the tasks that are left of its chain."""

    process: SpawnProcess
    pipe: Connection
    chain: deque[Any]

    def begin(self, chain: Sequence[Any]) -> None:
        self.chain = deque(chain)
        self.pipe.send(self.chain[0])

    def answer(self) -> Any:  # noqa: ANN401  # what the function returned
        """What it says of its task."""
        try:
            return self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.join()
            return Died(self.process.exitcode or 0)


@contextmanager
def _crew() -> Iterator[Callable[[Callable[..., Any]], _Worker]]:
    """Gives a function that starts a worker; ends all of them."""
    context = multiprocessing.get_context("spawn")
    hired: list[_Worker] = []

    def hire(perform: Callable[..., Any]) -> _Worker:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(perform, theirs), daemon=True)
        with _without_interrupts():
            process.start()
        theirs.close()  # so that its end is known when the process dies
        hired.append(_Worker(process, ours, deque()))
        return hired[-1]

    try:
        yield hire
    finally:
        for worker in hired:
            worker.process.terminate()
        for worker in hired:
            worker.process.join()
            worker.pipe.close()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes that are started in here never see a Ctrl-C: it is for the one that started them.

    The tracker that Python starts with the first of them would let interrupts in again.
    """
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(perform: Callable[..., Any], pipe: Connection) -> None:
    """What a worker does: tasks, until nobody gives it any."""
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    os.dup2(2, 1)  # whatever a plug-in prints is no result
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(perform(task))


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
