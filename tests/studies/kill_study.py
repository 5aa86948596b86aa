"""Kills studies at random moments, resumes them, and compares their tables.

    python -m tests.studies.kill_study --count 60 --seed 1

Each kill ends the command, one of its workers, or the whole process group, by SIGKILL or SIGTERM.
Then the same command runs again. A kill must leave no unknown file except in ``unfinished``, no
process may print a traceback, and the resumed study must have the same files and, but for wall
times, the same table to the bit as an unbroken one.
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
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
SMALL = ("--steps", "60", "--population", "6", "--generations", "2")
ABLATE = ("ablate", "--robots", "quadruped", "--seed", "5", "--case", "1,9", "--kinds", "paper")
SUITE = ("suite", "run", "--domains", "quadruped", "--case", "1,9", "--workers", "1")
BOTH = ("--comparator", "forward-displacement,gait-pattern")
STUDIES = {
    "ablate": (*ABLATE, *SMALL, *BOTH, "--trials", "2", "--workers", "2"),
    "ablate --next-trial repair": (
        *(*ABLATE, *SMALL, "--comparator", "forward-displacement"),
        *("--trials", "3", "--next-trial", "repair", "--workers", "1"),
    ),
    "suite run": (*SUITE, *SMALL),
}
VICTIMS = ("command", "worker", "group")
SIGNALS = (signal.SIGKILL, signal.SIGTERM)


def state_of(folder: Path) -> tuple[frozenset[str], list[dict]]:
    """Returns the names of all files of a study, and its table without wall times."""
    out = folder / "out"
    files = frozenset(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    results = out / "results.json"
    rows = json.loads(results.read_text())["rows"] if results.exists() else []
    return files, [{key: row[key] for key in row if key != "seconds"} for row in rows]


def start(study: str, folder: Path) -> "subprocess.Popen[bytes]":
    """Starts a study in a process group of its own, and waits for its first file."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "stderr").open("ab") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "selfmodel", *STUDIES[study], "--out", "out"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"},
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            start_new_session=True,
        )
    while not state_of(folder)[0]:
        time.sleep(0.005)
    return process


def kill(victim: str, number: signal.Signals, process: "subprocess.Popen[bytes]") -> None:
    """Sends the signal; a victim that has ended, or has not begun, receives none (Linux)."""
    if process.poll() is None and victim == "command":
        process.send_signal(number)
    elif process.poll() is None and victim == "group":
        os.killpg(process.pid, number)
    elif process.poll() is None:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for child in children:
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                os.kill(int(child), number)
                return


def main() -> None:
    """Prints a line per kill, and ends with an error at the first broken promise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    each = itertools.cycle(itertools.product(STUDIES, VICTIMS, SIGNALS))
    with tempfile.TemporaryDirectory() as name:
        references = {}
        for study in STUDIES:
            folder, begin = Path(name, study), time.monotonic()
            assert start(study, folder).wait() == 0
            references[study] = (*state_of(folder), time.monotonic() - begin)
        for count, (study, victim, number) in enumerate(itertools.islice(each, options.count)):
            files, rows, duration = references[study]
            folder, moment = Path(name, str(count)), float(rng.uniform())
            process = start(study, folder)
            time.sleep(moment * duration)
            kill(victim, number, process)
            process.wait(timeout=120)
            left = state_of(folder)[0]
            unknown = {name for name in left - files if not name.startswith("unfinished/")}
            status = start(study, folder).wait(timeout=120)
            told = (folder / "stderr").read_text()
            what = f"{study}: {victim} {number.name} at {moment:.2f}"
            assert not unknown, f"{what} left {unknown}"
            assert (status, "Traceback" in told) == (0, False), f"{what}: {told}"
            assert state_of(folder) == (files, rows), what
            print(f"{what}: {sum('cell.json' in name for name in left)} cells kept", flush=True)


if __name__ == "__main__":
    main()
