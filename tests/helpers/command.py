"""The command line as its users run it, in this process or in one of its own."""

import io
import json
import multiprocessing.process
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

from selfmodel.cli import main

SMALL = ("--population", "8", "--generations", "2")

DIAGNOSIS = (
    *("diagnosis", "verdict", "indistinguishable", "undetectable", "test", "intact_distance"),
    *("unsearched", "calibration", "reason", "fit", "change", "residual", "probability"),
)
"""JSON keys of a diagnosis, in the output of a recovery and of `selfmodel diagnose`."""

Done = subprocess.CompletedProcess[str]


def selfmodel(*arguments: str, cwd: Path, **environment: str) -> Done:
    """Runs the command in this process, as if started in that folder with piped output.

    Signals, OpenGL and a command's imports need a process of its own: see ``selfmodel_process``.
    """
    stdout, stderr = io.StringIO(), io.StringIO()
    with (
        as_started_in(cwd, ["selfmodel", *map(str, arguments)], environment),
        redirect_stdout(stdout),
        redirect_stderr(stderr),
    ):
        try:
            main()
            status = 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
    # The command counts warnings, which are errors in every other test.
    assert "note: Python warned" not in stderr.getvalue(), stderr.getvalue()
    return Done(arguments, status, stdout.getvalue(), stderr.getvalue())


def succeeds(*arguments: str, cwd: Path, **environment: str) -> Done:
    """Runs a command like ``selfmodel``; it ends with status 0."""
    done = selfmodel(*arguments, cwd=cwd, **environment)
    assert done.returncode == 0, done.stderr
    return done


def printed(*arguments: str, cwd: Path, **environment: str) -> dict:
    """Runs a command with ``--json`` like ``succeeds``, and returns what it printed."""
    return json.loads(succeeds(*arguments, cwd=cwd, **environment).stdout)


def selfmodel_process(*arguments: str, cwd: Path, **environment: str) -> Done:
    """Runs the command in a process of its own, in a folder, with its output piped."""
    return subprocess.run(
        [sys.executable, "-m", "selfmodel", *arguments],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def refused(*arguments: str, said: str, cwd: Path, **environment: str) -> Done:
    """Runs a command with wrong input, which ends with status 2, one sentence, and no result."""
    done = selfmodel(*arguments, cwd=cwd, **environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    return done


@contextmanager
def as_started_in(folder: Path, argv: list[str], environment: dict[str, str]) -> Iterator[None]:
    """Sets what a new process would have, and restores it; modules in the folder are forgotten."""
    before = Path.cwd(), sys.argv, list(sys.path), dict(os.environ), set(sys.modules)
    spawned_in = multiprocessing.process.ORIGINAL_DIR
    os.chdir(folder)
    os.environ.update(environment)
    places = [folder, *map(Path, filter(None, environment.get("PYTHONPATH", "").split(os.pathsep)))]
    places = [place.resolve() for place in places]
    sys.argv, sys.path[:0] = argv, map(str, places)
    # Worker processes start in the folder in which their parent started.
    multiprocessing.process.ORIGINAL_DIR = str(folder)
    try:
        yield
    finally:
        os.chdir(before[0])
        sys.argv, sys.path[:] = before[1], before[2]
        os.environ.clear()
        os.environ.update(before[3])
        multiprocessing.process.ORIGINAL_DIR = spawned_in
        for name in set(sys.modules) - before[4]:
            file = getattr(sys.modules[name], "__file__", None)
            if file is not None and Path(file).parent in places:
                del sys.modules[name]
