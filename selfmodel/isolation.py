"""Foreign models and recordings are opened in a child process, which may crash in our place.

The child is an ordinary interpreter. It gets a JSON header and named buffers on its standard input,
answers in the same form, and has limits of memory and processor time. A crash or a limit becomes
one sentence that names the file.
"""

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

from selfmodel.errors import InputError, WorkError

MODEL_SECONDS = 60
"""Processor time for a model, s; a robot's takes less than one."""

RECORDING_SECONDS = 3600
"""Processor time for a recording, s; a bag of 1 GB takes about a minute."""

_WALL_FACTOR = 3
"""Time per processor time after which a child ends: it may wait for other processes."""

_MEMORY_SHARE = 0.8
"""Share of the available memory that a child may take."""


@dataclass(frozen=True, eq=False)
class Message:
    """Request to a child, or its answer: a JSON object, and bytes by name."""

    header: Mapping[str, Any]
    buffers: Mapping[str, bytes] = field(default_factory=dict)


Task = Callable[[Message], Message]
"""Function that runs in a child. ``tempfile.gettempdir()`` is a folder of its own there."""


class IsolationError(InputError):
    """The child ended without an answer: it crashed, or reached a limit."""


def run_isolated(
    task: str, request: Message, *, what: str, seconds: int = MODEL_SECONDS
) -> Message:
    """Returns the answer of a ``Task``, ``module:function``, that runs in a child process.

    The child has that many seconds of processor time.

    Raises:
        IsolationError: The child crashed, or reached a limit; the message has ``what`` it read.
        InputError: The function raised it.
        WorkError: The function raised it.
    """
    with TemporaryDirectory(prefix="selfmodel-") as scratch:
        try:
            child = subprocess.run(  # noqa: S603  # this interpreter, and a task of this package
                [sys.executable, "-P", "-m", "selfmodel.isolation", task, str(seconds)],
                input=b"".join(_parts(request)),
                capture_output=True,
                env=_environment(scratch),
                timeout=_WALL_FACTOR * seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise _ended(what, -signal.SIGXCPU, seconds) from None
    if child.returncode:
        raise _ended(what, child.returncode, seconds)
    answer = _parsed(child.stdout)
    if "error" in answer.header:
        raise _error(what, **answer.header)
    return answer


def available_memory() -> int:
    """Returns the memory that is available to this process, bytes.

    It is the kernel's estimate, within the limit of the process's control group; where the system
    has neither, half of the physical memory.
    """
    found = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2]
    with suppress(OSError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        found = [int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable")]
    with suppress(OSError, ValueError):  # no control group, or "max"
        group = Path("/sys/fs/cgroup")
        limit, used = (int((group / f"memory.{name}").read_text()) for name in ("max", "current"))
        found.append(max(0, limit - used))
    return min(found)


def _environment(scratch: str) -> dict[str, str]:
    # The child imports this package from where it is, and nothing from the working folder. One
    # thread: each would reserve memory.
    package = str(Path(__file__).parents[1])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "TMPDIR": scratch,
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }


def _ended(what: str, status: int, seconds: int) -> IsolationError:
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return IsolationError(
            f"{what} takes more than {seconds} s of processor time, or more memory than this "
            f"computer has: make it smaller"
        )
    reason = signal.Signals(-status).name if status < 0 else f"status {status}"
    return IsolationError(f"{what} made the process that read it crash with {reason}")


def _error(what: str, error: str, text: str) -> Exception:
    if error == "MemoryError":
        return IsolationError(f"{what} takes more memory than this computer has: make it smaller")
    if error == "RecursionError":
        return InputError(f"{what} is nested too deeply")
    for known in (IsolationError, InputError, WorkError):
        if known.__name__ == error:
            return known(text)
    return RuntimeError(f"error in the child process of {what}:\n{text}")


def _parts(message: Message) -> list[bytes]:
    sizes = {name: len(data) for name, data in message.buffers.items()}
    head = json.dumps({"header": message.header, "sizes": sizes}).encode()
    return [len(head).to_bytes(8, "little"), head, *message.buffers.values()]


def _parsed(data: bytes) -> Message:
    end = 8 + int.from_bytes(data[:8], "little")
    head = json.loads(data[8:end])
    buffers = {}
    for name, size in head["sizes"].items():
        buffers[name] = data[end : end + size]
        end += size
    return Message(head["header"], buffers)


def _limit(seconds: int) -> None:
    """Limits this process's processor time, its memory and its core dump, for good."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))  # SIGXCPU, then SIGKILL
    with suppress(OSError):  # only Linux has this file, and enforces this limit
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        size = pages * resource.getpagesize() + int(_MEMORY_SHARE * available_memory())
        resource.setrlimit(resource.RLIMIT_AS, (size, size))


def _answer(task: Task, request: Message) -> Message:
    try:
        return task(request)
    except (InputError, WorkError, MemoryError, RecursionError) as error:
        error.__traceback__ = None  # it may hold the memory
        name, text = type(error).__name__, str(error)
    except Exception:  # noqa: BLE001  # a defect of the task: the caller raises its traceback
        name, text = "", traceback.format_exc()
    return Message({"error": name, "text": text})


def _main(place: str, seconds: str) -> None:
    output: BinaryIO = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library may print
    module, _, name = place.partition(":")
    task: Task = getattr(importlib.import_module(module), name)
    request = _parsed(sys.stdin.buffer.read())
    _limit(int(seconds))
    with output:
        output.writelines(_parts(_answer(task, request)))


if __name__ == "__main__":
    _main(*sys.argv[1:])
