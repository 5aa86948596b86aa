"""Stop signals: SIGINT, SIGTERM and SIGHUP end a trial in order, and the program after it.

Python raises ``KeyboardInterrupt`` at SIGINT, between any two instructions, and exits at once at
the other two. Here, all three raise an exception that is a ``KeyboardInterrupt``, once, and never
while they are held: not while a safe command is sent, and not while a log is written or closed.
"""

import os
import signal
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from types import FrameType, TracebackType
from typing import Generic, Self, TypeVar

Item = TypeVar("Item")

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

REPETITION = 0.2
"""Seconds after a stop signal in which another one counts as the same one: ``timeout``, systemd and
a terminal that closes send two within milliseconds."""


class Terminated(KeyboardInterrupt, SystemExit):
    """The process received SIGTERM or SIGHUP.

    Whatever handles Ctrl-C handles it as well. Uncaught, it ends the program as ``SystemExit``
    does: without a traceback, and with the exit status of the signal, 143 or 129.

    Args:
        number: The signal.
    """

    def __init__(self, number: signal.Signals) -> None:
        super().__init__(number.name)
        self.code = self.status = _exit_status(number)


def _exit_status(number: int) -> int:
    """Returns the exit status that a shell reports for a program that a signal ended."""
    return 128 + number


def status_of(interruption: KeyboardInterrupt) -> int:
    """Returns the exit status of a program that an interruption ends."""
    if isinstance(interruption, Terminated):
        return interruption.status
    return _exit_status(signal.SIGINT)


class _Mode(Enum):
    """Treatment of a stop signal.

    Attributes:
        FREE: The signal is raised at once.
        HELD: The signal is raised at the end of the region.
        RELEASED: The signal is raised at once, and again after the region if code in the region
            caught it.
    """

    FREE = "free"
    HELD = "held"
    RELEASED = "released"


@dataclass(eq=False)
class _Handler:
    """Handler of the stop signals of a process, and what it received.

    Attributes:
        mode: Treatment of a signal.
        waiting: Signal that has not ended anything yet.
        received: Time of the first signal, s, of ``time.monotonic``.
    """

    mode: _Mode = _Mode.FREE
    waiting: signal.Signals | None = None
    received: float | None = None

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        """Handles a signal: the first one is raised, a later one ends the process."""
        now = time.monotonic()
        if self.received is not None:
            if now - self.received > REPETITION:
                os._exit(_exit_status(number))
            return
        self.received = now
        if self.mode is not _Mode.FREE:
            self.waiting = signal.Signals(number)
        if self.mode is not _Mode.HELD:
            raise _interruption(number)

    def raise_waiting(self) -> None:
        """Raises the signal that has not ended anything yet, if there is one."""
        number, self.waiting = self.waiting, None
        if number is not None:
            raise _interruption(number)


def _interruption(number: int) -> KeyboardInterrupt:
    return KeyboardInterrupt() if number == signal.SIGINT else Terminated(signal.Signals(number))


_handler: _Handler | None = None


@contextmanager
def handle_stop_signals() -> Iterator[None]:
    """Context manager in which SIGINT, SIGTERM and SIGHUP end the program in order.

    The first of them raises ``KeyboardInterrupt`` (SIGINT) or its subclass ``Terminated`` in the
    main thread: a robot's safe command is sent, and its log is closed. Another one after 0.2 s ends
    the process at once, with the exit status 130, 143 or 129.

    A signal that is ignored, as SIGHUP under ``nohup``, or for which the program has a handler of
    its own, keeps its treatment. Outside of the main thread the context manager has no effect,
    because Python allows handlers of signals only there.

    ``run_trial``, ``recover`` and the command line enter it. Other programs that run a robot do so
    themselves, to be protected between two trials as well.

    Example:
        >>> from selfmodel.physical import handle_stop_signals
        >>> with handle_stop_signals():
        ...     pass  # trials, and the program's own code between them
    """
    global _handler  # noqa: PLW0603  # handlers of signals belong to the process
    defaults = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    replaced = {number: kept for number, kept in before.items() if kept in defaults}
    if not replaced or not _in_main_thread():
        yield
        return
    outer, handler = _handler, _Handler()
    try:
        _handler = handler
        for number in replaced:
            signal.signal(number, handler)
        yield
    finally:
        handler.mode = _Mode.HELD  # until all handlers are restored
        for number, kept in replaced.items():
            signal.signal(number, kept)
        _handler = outer
        handler.raise_waiting()


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


class _Region:
    """Context manager that sets the mode of the handler, if the main thread has one.

    Args:
        mode: Mode of the region.
    """

    def __init__(self, mode: _Mode) -> None:
        self._mode = mode

    def __enter__(self) -> None:
        """Enters the region."""
        self._handler = handler = _handler if _in_main_thread() else None
        if handler is not None:
            self._before = handler.mode
            handler.mode = self._mode
            # In this order: a signal in between would wait while the code of the region blocks. If
            # it is raised here, the end of the outer region restores the mode.
            if self._mode is _Mode.RELEASED:
                handler.raise_waiting()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leaves the region, and raises the signal that was held."""
        if (handler := self._handler) is not None:
            handler.mode = self._before
            if isinstance(error, KeyboardInterrupt):
                handler.waiting = None
            elif self._before is not _Mode.HELD:
                handler.raise_waiting()


def hold_stop_signals() -> _Region:
    """Returns a context manager that holds stop signals until its end."""
    return _Region(_Mode.HELD)


def release_stop_signals() -> _Region:
    """Returns a context manager in which stop signals that were held are raised at once.

    It is for code that may block, such as a driver, inside of a region that holds the signals. It
    has no effect outside of such a region.
    """
    return _Region(_Mode.RELEASED)


class HeldIterator(Generic[Item]):
    """Iterator over a generator whose code runs with stop signals held.

    Args:
        generator: The generator; ``close`` closes it.
    """

    def __init__(self, generator: Generator[Item, None, None]) -> None:
        self._generator = generator

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Item:
        with hold_stop_signals():
            return next(self._generator)

    def close(self) -> None:
        """Closes the generator."""
        with hold_stop_signals():
            self._generator.close()
