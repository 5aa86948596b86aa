"""How a robot is stopped: by signals, by cleanup, by a watchdog of its driver.

Python raises ``KeyboardInterrupt`` at SIGINT, between any two instructions, and exits at once at
SIGTERM and SIGHUP. Here all three raise an exception that is a ``KeyboardInterrupt``, once, and not
in a critical section: while a safe command is sent, or while a log is written or closed.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from types import FrameType, TracebackType
from typing import Any, Generic, Self, TypeVar

from selfmodel.errors import TrialError, WorkError, describe

Item = TypeVar("Item")

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

REPETITION = 0.2
"""Seconds after a stop signal in which another one counts as the same one: ``timeout``, systemd and
a terminal that closes send two within milliseconds."""


class Terminated(KeyboardInterrupt, SystemExit):
    """The process received SIGTERM or SIGHUP.

    Whatever handles Ctrl-C handles it as well. Uncaught, it ends the program as ``SystemExit``
    does: without a traceback, and with the exit status of the signal, 143 or 129.
    """

    def __init__(self, number: signal.Signals) -> None:
        super().__init__(number.name)
        self.code = self.status = _ENDED + number


_ENDED = 128
"""What a shell adds to the number of the signal that ended a program, for its exit status."""


def status_of(interruption: KeyboardInterrupt) -> int:
    """Returns the exit status of a program that an interruption ends."""
    return interruption.status if isinstance(interruption, Terminated) else _ENDED + signal.SIGINT


class _Handler:
    """Handler of the stop signals of a process: the first is raised, a later one ends the process.

    Because only one signal is ever raised, its exception may leave ``held`` as it is.

    Attributes:
        held: Whether a signal waits for the end of the critical section; None outside of any.
        waiting: Signal of a critical section that has not ended it yet.
    """

    def __init__(self) -> None:
        self.held: bool | None = None
        self.waiting: signal.Signals | None = None
        self._received: float | None = None

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if self._received is not None:
            if now - self._received > REPETITION:
                os._exit(_ENDED + number)
            return
        self._received, self.waiting = now, signal.Signals(number)
        if not self.held:
            self.raise_waiting(forget=self.held is None)

    def raise_waiting(self, *, forget: bool) -> None:
        """Raises the waiting signal.

        Unless it is to be forgotten, it is raised again at the end of the critical section, because
        a driver may catch any exception.
        """
        number = self.waiting
        if forget:
            self.waiting = None
        if number is not None:
            raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)


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
        handler.held = True  # until all handlers are restored
        for number, kept in replaced.items():
            signal.signal(number, kept)
        _handler = outer
        handler.raise_waiting(forget=True)


class _Section:
    """Part of a program in which stop signals are held or not, if the main thread has a handler.

    It is no ``contextlib.contextmanager``: a signal between such a one's code and the block would
    leave it open.
    """

    def __init__(self, *, held: bool) -> None:
        self._held = held

    def __enter__(self) -> None:
        self._handler = handler = _handler if _in_main_thread() else None
        if handler is not None:
            self._outer = handler.held
            handler.held = self._held if self._held or self._outer is not None else None
            # In this order: a signal in between would wait while the code of the section blocks.
            if not self._held:
                handler.raise_waiting(forget=self._outer is None)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leaves the section, and raises the signal that was held or whose exception was lost."""
        if (handler := self._handler) is not None:
            handler.held = self._outer
            if isinstance(error, KeyboardInterrupt):
                handler.waiting = None
            elif not self._outer:
                handler.raise_waiting(forget=True)


def hold_stop_signals() -> _Section:
    """Returns a critical section: a context manager that holds stop signals until its end."""
    return _Section(held=True)


def release_stop_signals() -> _Section:
    """Returns a context manager in which stop signals that were held are raised at once.

    It is for code that may block, such as a driver, inside of a critical section. It has no effect
    outside of one.
    """
    return _Section(held=False)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


class HeldIterator(Generic[Item]):
    """Iterator over a generator whose code is a critical section; ``close`` closes it."""

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


@contextmanager
def cleanup(action: Callable[[], object]) -> Iterator[None]:
    """Context manager that runs an action at the end of its block.

    An exception of the block, such as Ctrl-C, is raised in any case: a failure of the action is
    added to it as a note, where ``contextlib.ExitStack`` would raise the failure instead. After
    a block without an exception, or in a closed generator, a failure of the action is raised. The
    action may raise ``OSError`` or ``WorkError``.
    """
    try:
        yield
    except GeneratorExit:
        action()
        raise
    except BaseException as reason:
        try:
            action()
        except (OSError, WorkError) as failure:
            reason.add_note(describe(failure))
        raise
    action()


class HangError(TrialError):
    """A driver that did not return in time."""


class Watchdog:
    """Context manager with a thread that calls a driver; each call returns in time, or raises.

    A call of Python code cannot be ended from outside. So the thread that may hang is the driver's,
    and the thread that runs the trial sends the safe command, closes the log and ends the program.

    After a call that did not return, because of the time limit or of a signal, the end of the block
    makes the thread send the safe command once more as soon as the call returns: the driver may
    have sent targets after the first safe command. The end of the block waits for that for at most
    ``seconds``, the time limit of a call; the thread waits longer, until the process ends.
    """

    def __init__(self, seconds: float, send_safe: Callable[[], object]) -> None:
        self._seconds, self._send_safe = seconds, send_safe
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._outcomes: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, name="selfmodel driver", daemon=True)
        self._waiting = False

    @property
    def hangs(self) -> bool:
        """Whether a call has not returned."""
        return self._waiting and self._thread.is_alive()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def call(self, what: str, function: Callable[[], Any]) -> Any:  # noqa: ANN401  # any function
        """Calls a function in the driver's thread; returns its result, or raises its exception.

        Raises:
            HangError: The function, of the name ``what``, did not return in time.
        """
        self._waiting = True
        self._calls.put(function)
        try:
            result, error = self._outcomes.get(timeout=self._seconds)
        except Empty:
            raise HangError(
                f"the driver did not return from {what} within {self._seconds:g} s"
            ) from None
        self._waiting = False
        if error is not None:
            raise error
        return result

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._waiting:
            self._calls.put(self._send_safe)
        self._calls.put(None)
        self._thread.join(self._seconds)
        if self.hangs and error is not None:
            error.add_note(f"nor within another {self._seconds:g} s, after the safe command")

    def _serve(self) -> None:
        while (function := self._calls.get()) is not None:
            try:
                self._outcomes.put((function(), None))
            except BaseException as failure:  # noqa: BLE001  # `call` raises it in the caller's thread
                self._outcomes.put((None, failure))
