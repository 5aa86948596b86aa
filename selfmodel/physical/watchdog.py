"""Watchdog of a driver: a thread that calls the driver, so that the main thread can stop waiting.

A call of Python code cannot be ended from outside. So the thread that may hang is the driver's, and
the thread that runs the trial sends the safe command, closes the log and ends the program.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Self

from selfmodel.errors import TrialError


class HangError(TrialError):
    """A driver that did not return in time."""


@dataclass(frozen=True)
class _Outcome:
    """Result of a call, or its error."""

    result: Any = None
    error: BaseException | None = None


class Watchdog:
    """Context manager with a thread that calls a driver; each call returns in time, or raises.

    After a call that did not return, because of the time limit or of a signal, the end of the block
    makes the thread send the safe command once more as soon as the call returns: the driver may
    have sent targets after the first safe command. The end of the block waits for that for at most
    ``seconds``; the thread waits longer, until the process ends.

    Args:
        seconds: Time limit of a call, s.
        send_safe: Sends the safe command.
    """

    def __init__(self, seconds: float, send_safe: Callable[[], object]) -> None:
        self._seconds, self._send_safe = seconds, send_safe
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._outcomes: SimpleQueue[_Outcome] = SimpleQueue()
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

        Args:
            what: Name of the function in the error message.
            function: The function.

        Raises:
            HangError: The function did not return in time.
        """
        self._waiting = True
        self._calls.put(function)
        try:
            outcome = self._outcomes.get(timeout=self._seconds)
        except Empty:
            raise HangError(
                f"the driver did not return from {what} within {self._seconds:g} s"
            ) from None
        self._waiting = False
        if outcome.error is not None:
            raise outcome.error
        return outcome.result

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
                outcome = _Outcome(result=function())
            except BaseException as failure:  # noqa: BLE001  # `call` raises it in the caller's thread
                outcome = _Outcome(error=failure)
            self._outcomes.put(outcome)
