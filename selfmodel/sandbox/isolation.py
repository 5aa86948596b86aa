"""Isolation: runs a function on untrusted bytes in a child process with limits."""

import atexit
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.sandbox.budget import Budget, BudgetError
from selfmodel.sandbox.message import OUT_OF_MEMORY, Message, MessageError, receive, send


@dataclass(frozen=True)
class Isolated:
    """Result of a task in a child process.

    Attributes:
        facts: JSON object of the result.
        blobs: Bytes of the result by name.
        seconds: Processor time of the child, s.
        peak: Address space that the task took, bytes; 0 where unknown.
    """

    facts: Mapping[str, Any]
    blobs: Mapping[str, bytes]
    seconds: float
    peak: int


class ChildError(InputError):
    """The child process ended without a result, by a crash, the limit of memory or of time."""


def run_isolated(
    task: str,
    message: Message,
    *,
    what: str,
    budget: Budget,
    errors: tuple[type[Exception], ...] = (),
) -> Isolated:
    """Runs a function in a child process that has the limits of a budget.

    The child can create files in a scratch folder only, which is removed afterwards. Where the
    platform has no ``fork``, the call raises ``OSError``.

    Args:
        task: Function as ``module:function``; see ``selfmodel.sandbox.server.Task``.
        message: Argument of the function.
        what: The input of the task in an error message, such as the file's name.
        budget: Limits of the child.
        errors: Exceptions of the task that are raised again here, with their public attributes as
            keyword arguments; ``InputError`` always is.

    Raises:
        BudgetError: The task takes more memory or time than the budget allows.
        ChildError: The child crashed.
        InputError: The task raised it; so for each class in ``errors``.
    """
    with _lock, TemporaryDirectory(prefix="selfmodel-") as scratch:
        try:
            answer, ended = _server().call(task, message, budget, Path(scratch))
        except BaseException:  # raised again below, for Ctrl-C too: only the server is stopped
            # The next call must not receive the answer of this one.
            _stop_server()
            raise
    if answer is None:
        raise _ended(what, int(ended["status"]), budget)
    facts = dict(answer.facts)
    if "error" in facts:
        raise _error(what, facts, budget, errors)
    return Isolated(facts["result"], answer.blobs, float(ended["seconds"]), int(facts["peak"]))


def _ended(what: str, status: int, budget: Budget) -> InputError:
    if status in (-signal.SIGXCPU, -signal.SIGALRM):
        return BudgetError(
            f"{what} takes more than {budget.file_seconds:.3g} s of processor time: to go on, "
            f"raise the time with --budget time=..., from {budget.time:g} s"
        )
    if status == OUT_OF_MEMORY:
        return _too_large(what, budget)
    if status < 0:
        reason = signal.Signals(-status).name
        return ChildError(f"{what} made the process that read it crash with {reason}")
    return ChildError(f"{what} made the process that read it end with status {status}")


def _too_large(what: str, budget: Budget) -> BudgetError:
    return BudgetError(
        f"{what} takes more than {budget.memory / 1e9:.3g} GB of memory: to go on, raise it "
        f"with --budget memory=..."
    )


def _error(
    what: str, facts: Mapping[str, Any], budget: Budget, errors: tuple[type[Exception], ...]
) -> Exception:
    name, text, fields = facts["error"], facts["message"], facts["fields"]
    if name == "MemoryError":
        return _too_large(what, budget)
    if name == "RecursionError":
        return InputError(f"{what} is nested too deeply")
    for known in (*errors, InputError, BudgetError):
        if known.__name__ == name:
            error: Exception = known(**fields) if fields else known(text)
            return error
    if name:
        return WorkError(text)
    return RuntimeError(f"error in the child process of {what}:\n{text}")


class _Server:
    """Server process of this process."""

    def __init__(self) -> None:
        self._owner = os.getpid()
        own, other = socket.socketpair()
        # The child's path contains this package, and not the working folder.
        package = str(Path(__file__).parents[2])
        paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._control = own
        with other:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "selfmodel.sandbox.server"],
                stdin=other.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={
                    **os.environ,
                    "PYTHONPATH": os.pathsep.join(paths),
                    "OPENBLAS_NUM_THREADS": "1",  # a fork copies no threads
                    "OMP_NUM_THREADS": "1",
                },
                start_new_session=True,  # Ctrl-C is for the client
            )

    def call(
        self, task: str, message: Message, budget: Budget, scratch: Path
    ) -> tuple[Message | None, Mapping[str, Any]]:
        """Returns the answer of a child, None if it ended without, and the use of the child."""
        request = {
            "task": task,
            "memory": budget.memory,
            "time": budget.time,
            "scratch": str(scratch),
        }
        own, other = socket.socketpair()
        with own:
            with other:
                socket.send_fds(self._control, [b"\0"], [other.fileno()])
            send(self._control, Message(request))
            answer = _exchange(own, message, budget)
        try:
            return answer, receive(self._control, 0).facts
        except (MessageError, OSError) as error:
            raise WorkError("the process that reads files ended unexpectedly") from error

    @property
    def has_ended(self) -> bool:
        """Whether the idle server was killed, such as for lack of memory."""
        try:
            return not self._control.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def stop(self) -> None:
        """Ends the server, and a child that is running."""
        self._control.close()
        if self._owner == os.getpid():
            with suppress(ProcessLookupError, PermissionError):  # the server has ended already
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


def _exchange(channel: socket.socket, message: Message, budget: Budget) -> Message | None:
    try:
        send(channel, message)
    except OSError:
        return None  # the child ended before it had read the message
    try:
        return receive(channel, budget.memory)
    except (MessageError, OSError):
        return None


_lock = threading.Lock()
_servers: list[_Server] = []


def _server() -> _Server:
    """Server of this process."""
    if _servers and _servers[-1].has_ended:
        _stop_server()
    if not _servers:
        _servers.append(_Server())
    return _servers[-1]


@atexit.register
def _stop_server() -> None:
    while _servers:
        _servers.pop().stop()


def _start_anew() -> None:
    """Prepares a forked process, which starts a server of its own."""
    global _lock  # noqa: PLW0603  # a thread that the fork does not have may hold the lock
    _lock = threading.Lock()
    _stop_server()  # closes the copy of the channel: the server ends with its own client


os.register_at_fork(after_in_child=_start_anew)
