"""Server process: forks a restricted child per request, so that a child costs milliseconds.

The server imports the modules of the tasks; it never reads a file's content itself.
"""

import importlib
import os
import resource
import select
import shutil
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.limits import address_space, restrict
from selfmodel.sandbox.message import OUT_OF_MEMORY, Message, receive, send

Task = Callable[[Message, Budget, Path], Message]
"""Function that runs in a child: the request, the budget and the scratch folder."""


def serve(control: socket.socket) -> None:
    """Serves requests until the client closes the control channel.

    A request is one byte with the file descriptor of a data channel, on which the child receives
    its message and sends its answer, and then a message (``task``, ``memory``, ``time``,
    ``scratch``). The server's own answer is the exit status and the use of the child.

    Args:
        control: Channel from the client.
    """
    for ended in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ended, signal.SIG_IGN)  # the client decides; its end closes the channel
    while True:
        byte, descriptors, _, _ = socket.recv_fds(control, 1, 1)
        if not byte:
            return
        facts = receive(control, 0).facts
        module, _, name = facts["task"].partition(":")
        task = getattr(importlib.import_module(module), name)
        # The child's end of the pipe is closed by its death only.
        alive, end = os.pipe()
        with socket.socket(fileno=descriptors[0]) as channel:
            child = os.fork()
            if child == 0:
                control.close()
                _run(channel, task, facts)
        os.close(end)
        select.select([control.fileno(), alive], [], [])
        if _has_ended(control):  # the client was killed: nothing else ends the child
            os.kill(child, signal.SIGKILL)
        _, status, usage = os.wait4(child, 0)
        os.close(alive)
        if _has_ended(control):
            shutil.rmtree(facts["scratch"], ignore_errors=True)
            return
        answer = {
            "status": os.waitstatus_to_exitcode(status),
            "seconds": usage.ru_utime + usage.ru_stime,
        }
        send(control, Message(answer))


def _has_ended(control: socket.socket) -> bool:
    """Returns whether the client has closed its end; it sends nothing before it has an answer."""
    return bool(select.select([control], [], [], 0)[0])


def _run(channel: socket.socket, task: Task, facts: Mapping[str, Any]) -> None:
    """Runs a task in this child, and ends the process."""
    budget = Budget(facts["memory"], facts["time"])
    scratch = Path(facts["scratch"])
    status = 1
    try:
        for ended in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(ended, signal.SIG_DFL)
        message = receive(channel, sys.maxsize)
        before = address_space() or 0
        restrict(budget, scratch)
        answer = _answer(task, message, budget, scratch)
        peak = (address_space("VmPeak") or before) - before
        send(channel, Message({**answer.facts, "peak": peak}, answer.blobs))
        status = 0
    except MemoryError:
        status = OUT_OF_MEMORY
    except BaseException:  # noqa: BLE001  # any exception becomes the exit status
        status = _EX_SOFTWARE
    finally:
        os._exit(status)


_EX_SOFTWARE = 70


def _answer(task: Task, message: Message, budget: Budget, scratch: Path) -> Message:
    try:
        result = task(message, budget, scratch)
    except (InputError, WorkError) as error:
        name, own = type(error).__name__, {k: str(v) for k, v in vars(error).items() if k[0] != "_"}
        return Message({"error": name, "message": str(error), "fields": own})
    except (MemoryError, RecursionError) as error:
        # The traceback may hold the memory.
        error.__traceback__ = None
        return Message({"error": type(error).__name__, "message": "", "fields": {}})
    except Exception:  # noqa: BLE001  # a defect of the task: the client raises its traceback
        return Message({"error": "", "message": traceback.format_exc(), "fields": {}})
    return Message({"result": dict(result.facts)}, result.blobs)


def main() -> None:
    """Runs the server on the channel that is the process's standard input."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    channel = os.dup(0)
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # a child has no end of the control channel
    with socket.socket(fileno=channel) as control:
        serve(control)


if __name__ == "__main__":
    main()
