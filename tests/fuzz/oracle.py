"""Verdict on one case: exceptions, standard error, files, memory and CPU time.

A case passes if the code under test accepts it, or refuses it with an error that is declared for
invalid input; writes nothing on standard error; leaves no file but ``.part``; changes no input; and
stays within ``MEGABYTES`` and ``SECONDS``. The child processes of the sandbox belong to the case.
"""

import os
import re
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from selfmodel.errors import InputError, WorkError
from tests.fuzz.child_use import child_use
from tests.fuzz.target import Case

ROOT = Path(__file__).parents[2]

MEGABYTES = 1000
"""Largest growth of the memory by one case, 10^6 bytes."""

SECONDS = 10
"""Largest CPU time of one case, s: that of a child process by the default budget."""

MARGIN = 0.5
"""CPU time beside a child process that the budget's limit ended, s."""

DECLARED = (InputError, WorkError)
"""Errors for input that is refused; LogError is a WorkError."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on one case.

    Attributes:
        outcome: Result of the check, or the class of the declared error.
        problem: Report of a finding; "" if the case passes.
        place: Class and place of a finding, equal for findings of one cause; "" without one.
        megabytes: Growth of the memory at its peak, of this process or of a child, 10^6 bytes.
        seconds: CPU time with that of the children, s.
    """

    outcome: str
    problem: str
    place: str
    megabytes: float
    seconds: float


def judge(case: Case, folder: Path, output: Path) -> Verdict:
    """Runs a case in a new folder, and removes the folder if the case passes.

    Args:
        case: The case.
        folder: New folder, which becomes the working folder and that of temporary files.
        output: File that has everything written on standard output and standard error.
    """
    for name, data in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    os.chdir(folder)
    tempfile.tempdir = str(folder)
    os.truncate(output, 0)
    before = _memory()
    start = time.process_time()
    # A C function cannot be interrupted by a handler: the default action ends the process.
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    with child_use() as children:
        outcome, problem, place = _outcome(case)
    signal.setitimer(signal.ITIMER_PROF, 0)
    seconds = time.process_time() - start + children.seconds
    megabytes = max(_peak() - before, children.megabytes)
    if children.problem:
        problem, place = children.problem, f"child-{_child_place(children.problem)}"
    if not problem and (printed := output.read_text(errors="replace")):
        problem, place = f"printed:\n{printed}", f"printed-{_words(printed)}"
    if not problem and (files := _changed(case, folder)):
        problem, place = f"files left or changed: {files}", f"files-{_words(files)}"
    if not problem and megabytes > MEGABYTES:
        problem, place = f"took {megabytes:.0f} MB", "memory"
    if not problem and seconds > SECONDS + MARGIN:
        problem, place = f"took {seconds:.1f} s", "time"
    if not problem:
        os.chdir(folder.parent)
        shutil.rmtree(folder)
    return Verdict(outcome, problem, place, megabytes, seconds)


def _outcome(case: Case) -> tuple[str, str, str]:
    try:
        return case.check(), "", ""
    except DECLARED as error:
        if str(error).strip():
            return type(error).__name__, "", ""
        return "", traceback.format_exc(), f"empty-{_place(error)}"
    except BaseException as error:  # noqa: BLE001  # any undeclared exception is a finding
        return "", traceback.format_exc(), _place(error)


def _place(error: BaseException) -> str:
    """Class of an error and the innermost line of the package that raised it."""
    frames = [
        (frame.filename, frame.lineno or 0) for frame in traceback.extract_tb(error.__traceback__)
    ]
    detail = f"-{_words(str(error))}" if isinstance(error, AssertionError) else ""
    return f"{type(error).__name__}-{_own_line(frames[::-1])}{detail}"


def innermost(trace: str) -> str:
    """Returns the innermost line of the package in a trace of faulthandler."""
    found = re.findall(r'File "(.+)", line (\d+),? in', trace)
    return _own_line([(name, int(line)) for name, line in found])


def _child_place(problem: str) -> str:
    """Last line of a report, and the innermost line of the package in it."""
    lines = problem.strip().splitlines()[::-1]
    return f"{_words(lines[0])}-{innermost(chr(10).join(lines))}"


def _own_line(frames: Sequence[tuple[str, int]]) -> str:
    """First of some places that is in the package; otherwise the first one."""
    own = [
        (name, line)
        for name, line in frames
        if Path(name).is_relative_to(ROOT) and not Path(name).is_relative_to(ROOT / "tests/fuzz")
    ]
    name, line = next(iter([*own, *frames]), ("unknown", 0))
    return f"{Path(name).stem}-{line}"


def _words(text: str) -> str:
    """First letters of a text, for a file name; numbers are left out."""
    kept = "".join(char if char.isalpha() else " " for char in text)
    return "-".join(kept.split())[:60]


def _changed(case: Case, folder: Path) -> str:
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    left = [name for name in found - set(case.files) if not name.endswith(".part")]
    changed = [
        name
        for name, data in case.files.items()
        if name not in found or (folder / name).read_bytes() != data
    ]
    return ", ".join(sorted(left + changed))


def _memory() -> float:
    """Resets the peak of this process, and returns its memory, 10^6 bytes."""
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    return _status("VmRSS")


def _peak() -> float:
    return _status("VmHWM")


def _status(key: str) -> float:
    text = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    return int(text.partition(f"{key}:")[2].split()[0]) * 1024 / 1e6


@contextmanager
def captured(output: Path) -> Iterator[TextIO]:
    """Context manager that sends both outputs of this process to a file, warnings included.

    The outputs of C libraries are file descriptors; those of Python may be other objects.
    """
    with ExitStack() as stack:
        file = stack.enter_context(output.open("a", buffering=1, encoding="utf-8"))
        for descriptor in (1, 2):
            stack.callback(os.dup2, os.dup(descriptor), descriptor)
            os.dup2(file.fileno(), descriptor)
        stack.enter_context(redirect_stdout(file))
        stack.enter_context(redirect_stderr(file))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("always")
        yield file
