"""Kills studies at random moments, resumes them, and compares their tables.

    python -m tests.studies.kill_study --count 60 --seed 1

Each kill ends the command, one of its workers, or the whole process group, by SIGKILL or SIGTERM.
Then the same command runs again. The harness checks that a kill leaves no unknown file except in
``unfinished``, that no process prints a traceback, and that the resumed study has the same files
and, but for wall times, the same table to the bit as an unbroken one.
"""

import argparse
import itertools
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
SMALL = ("--steps", "60", "--population", "6", "--generations", "2")
_ABLATE = (
    *("ablate", "--robots", "quadruped", "--seed", "5", *SMALL, "--kinds", "paper"),
    "--comparator",
)
STUDIES = {
    "ablate": (
        *(*_ABLATE, "forward-displacement,gait-pattern", "--case", "1,9", "--trials", "2"),
        *("--workers", "2"),
    ),
    "ablate --next-trial repair": (
        *(*_ABLATE, "forward-displacement", "--case", "1,9", "--trials", "3"),
        *("--next-trial", "repair", "--workers", "1"),
    ),
    "suite run": (
        *("suite", "run", "--domains", "quadruped", "--case", "1,9", *SMALL, "--workers", "1"),
    ),
}
VICTIMS = ("command", "worker", "group")
SIGNALS = (signal.SIGKILL, signal.SIGTERM)


@dataclass(frozen=True)
class Unbroken:
    """A study that was not killed.

    Attributes:
        rows: Table without wall times.
        files: Names of all files.
        duration: Time from the first file to the end, s.
    """

    rows: list[dict[str, Any]]
    files: frozenset[str]
    duration: float


@dataclass(frozen=True)
class Kill:
    """One kill.

    Attributes:
        study: Key of ``STUDIES``.
        victim: One of ``VICTIMS``.
        number: The signal.
        moment: Time of the kill, from 0, the study's first file, to 1, the end of the unbroken
            study.
    """

    study: str
    victim: str
    number: signal.Signals
    moment: float


def kills(count: int, seed: int) -> Iterator[Kill]:
    """Yields kills: each study, victim and signal in turn, at random moments."""
    rng = np.random.default_rng(seed)
    each = itertools.cycle(itertools.product(STUDIES, VICTIMS, SIGNALS))
    for study, victim, number in itertools.islice(each, count):
        yield Kill(study, victim, number, float(rng.uniform()))


def unbroken(study: str, folder: Path) -> Unbroken:
    """Runs a study to its end in a folder."""
    process = _start(study, folder)
    _wait_for_a_file(folder)
    begin = time.monotonic()
    assert process.wait() == 0
    return Unbroken(rows_of(folder), files_of(folder / "out"), time.monotonic() - begin)


def kill_and_resume(kill: Kill, reference: Unbroken, folder: Path) -> int:
    """Kills a study in a new folder and resumes it.

    Returns:
        Number of cells that were finished at the kill.

    Raises:
        AssertionError: A promise is broken.
    """
    process = _start(kill.study, folder)
    _wait_for_a_file(folder)
    time.sleep(kill.moment * reference.duration)
    _send(kill, process)
    process.wait(timeout=120)
    found = files_of(folder / "out")
    unknown = {name for name in found - reference.files if not name.startswith("unfinished/")}
    assert not unknown, f"{kill} left {unknown}"

    again = _start(kill.study, folder)
    assert again.wait(timeout=120) == 0, f"{kill}: {(folder / 'stderr').read_text()}"
    assert "Traceback" not in (folder / "stderr").read_text(), kill
    assert files_of(folder / "out") == reference.files, kill
    assert rows_of(folder) == reference.rows, kill
    return sum(name.endswith("/cell.json") for name in found & reference.files)


def files_of(folder: Path) -> frozenset[str]:
    """Returns the names of all files in a folder."""
    return frozenset(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """Returns the table of a study without wall times; its floats are exact."""
    rows = json.loads((folder / "out" / "results.json").read_text())["rows"]
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows]


def _start(study: str, folder: Path) -> subprocess.Popen[bytes]:
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "stderr").open("ab") as stderr:
        return subprocess.Popen(
            [sys.executable, "-m", "selfmodel", *STUDIES[study], "--out", "out"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"},
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            start_new_session=True,
        )


def _wait_for_a_file(folder: Path) -> None:
    while not files_of(folder / "out"):
        time.sleep(0.005)


def _send(kill: Kill, process: subprocess.Popen[bytes]) -> None:
    """Sends the signal; a victim that has ended, or has not begun, receives none."""
    if process.poll() is not None:
        return
    match kill.victim:
        case "command":
            process.send_signal(kill.number)
        case "group":
            os.killpg(process.pid, kill.number)
        case "worker":
            for worker in _workers(process.pid)[:1]:
                os.kill(worker, kill.number)


def _workers(parent: int) -> Sequence[int]:
    """Returns the worker processes of a command (Linux)."""
    try:
        children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
        return [int(pid) for pid in children if b"spawn_main" in _command_line(pid)]
    except (FileNotFoundError, ProcessLookupError):
        return []


def _command_line(pid: str) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def main() -> None:
    """Prints a line per kill, and the number of broken promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    broken: list[str] = []
    done: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        references = {
            study: unbroken(study, folder / f"unbroken-{k}") for k, study in enumerate(STUDIES)
        }
        for number, kill in enumerate(kills(options.count, options.seed), start=1):
            what = f"{kill.study}: {kill.victim} {kill.number.name} at {kill.moment:.2f}"
            try:
                cells = kill_and_resume(kill, references[kill.study], folder / str(number))
                print(f"{number} {what}, {cells} cells kept, same table", flush=True)
            except (AssertionError, subprocess.TimeoutExpired) as error:
                broken.append(what)
                print(f"{number} {what}: {error}", flush=True)
            done[kill.victim, kill.number.name] += 1
    print(f"{sum(done.values()) - len(broken)} of {sum(done.values())} resumed to the same table")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
