"""``python -m benchmarks.campaigns``: executors, speed and kills of a study, on a quiet machine.

``table`` runs an ablation of the quadruped on processes and on a Dask cluster of two workers on
this machine, and compares the tables to the bit; ``speed`` measures one and two worker processes;
``kills`` kills drivers, workers and schedulers on the way, and continues with another executor.
With the default sizes, each study has more than 200 cells.
"""

import argparse
import csv
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
WORKERS = 2
EXECUTORS = ("processes", "dask")
VICTIMS = ("driver", "worker", "scheduler")


def main() -> None:
    """Runs the chosen measurement and prints it as JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns", description=__doc__)
    parser.add_argument("what", choices=("table", "speed", "kills"))
    parser.add_argument("--seeds", type=int, default=4, help="54 cells each")
    parser.add_argument("--population", type=int, default=20)
    parser.add_argument("--generations", type=int, default=5)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--pause", default="4,12", help="shortest and longest time to a kill, s")
    parser.add_argument("--seed", type=int, default=0, help="of the kills")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        measure = {"table": tables, "speed": speed, "kills": kills}[given.what]
        print(json.dumps(measure(given, Path(name)), indent=1))


def tables(given: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Returns wall times by executor, and whether the tables are the same to the bit."""
    with cluster(folder) as own:
        seconds = {name: run(given, folder / name, options(name, own)) for name in EXECUTORS}
    found = [table(folder / name) for name in EXECUTORS]
    return {"seconds": seconds, "rows": len(found[0]), "same_table": found[0] == found[1]}


def speed(given: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Returns wall times of the study with one and with two workers, and their ratios.

    ``overhead`` is the wall time with one worker over the time of the cells, less 1.
    """
    wall = {n: run(given, folder / str(n), ["--workers", str(n)]) for n in (1, 2)}
    cells = [json.loads(path.read_text()) for path in (folder / "1").glob("*/*/cell.json")]
    return {
        "cells": len(cells),
        "seconds_with_one": wall[1],
        "seconds_with_two": wall[2],
        "two_over_one": wall[1] / wall[2],
        "overhead": wall[1] / sum(cell["seconds"] for cell in cells) - 1,
    }


def kills(given: argparse.Namespace, folder: Path) -> dict[str, object]:
    """Runs a study to its end with kills on the way, and compares its table.

    A driver ends with another status than 0 if it was killed, or if its scheduler was; after the
    kill of a worker, any other status is unexpected.
    """
    rng, counts, unexpected = np.random.default_rng(given.seed), Counter[str](), []
    shortest, longest = map(float, given.pause.split(","))
    out = folder / "killed"
    with cluster(folder) as own:
        while counts.total() < given.kills:
            name = str(rng.choice(EXECUTORS))
            driver = start(command(given, out, options(name, own)), folder / "stderr")
            victim, expected = "", {0}
            while counts.total() < given.kills and driver.poll() is None:
                time.sleep(rng.uniform(shortest, longest))
                victim = str(rng.choice(VICTIMS[: 3 if name == "dask" else 2]))
                if driver.poll() is None and kill(victim, name, driver, own):
                    counts[f"{name} {victim}"] += 1
                    print(f"{counts.total()}: {name}, {victim}", file=sys.stderr, flush=True)
                    if victim != "worker":
                        expected = {0, -signal.SIGKILL} if victim == "driver" else {0, 1}
                        driver.wait()
                if name == "dask" and driver.poll() is None:
                    own.revive()
            if driver.wait() not in expected:
                end = (folder / "stderr").read_text().strip().splitlines()[-1:]
                unexpected.append(
                    f"{name}, after {victim or 'no kill'}: {driver.returncode}, {end}"
                )
            if driver.returncode == 0:
                break
    for place in (out, folder / "unbroken"):
        run(given, place, ["--workers", str(WORKERS)])
    return {
        "kills": dict(counts),
        "unexpected_ends": unexpected,
        "same_table": table(out) == table(folder / "unbroken"),
    }


def command(given: argparse.Namespace, out: Path, executor: list[str]) -> list[str]:
    """Returns the command of the study: cases 1 to 9, two gaps, two comparators."""
    return [
        *(sys.executable, "-m", "selfmodel", "ablate", "--robots", "quadruped", "--kinds", "paper"),
        *("--case", "1,2,3,4,5,6,7,8,9", "--gap", "0,0.05"),
        *("--comparator", "forward-displacement,segment-prediction", "--seeds", str(given.seeds)),
        *("--population", str(given.population), "--generations", str(given.generations)),
        *("--steps", str(given.steps), "--bank", str(ROOT / "benchmarks" / "bank")),
        *("--out", str(out), *executor),
    ]


def run(given: argparse.Namespace, out: Path, executor: list[str]) -> float:
    """Runs the study to its end, and returns the wall time, s."""
    errors, begin = out.with_name(f"{out.name}-stderr"), time.perf_counter()
    if start(command(given, out, executor), errors).wait():
        raise SystemExit(errors.read_text()[-2000:])
    return time.perf_counter() - begin


def start(arguments: list[str], stderr: Path) -> "subprocess.Popen[bytes]":
    """Starts a command in a process group of its own; its standard error is added to a file."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MUJOCO_GL": "disable"}
    with stderr.open("ab") as file:
        return subprocess.Popen(
            arguments,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=file,
            start_new_session=True,
        )


def table(out: Path) -> list[dict[str, str]]:
    """Returns the table of a finished study without wall times; its numbers are exact."""
    with (out / "results.csv").open(newline="") as file:
        return [
            {name: value for name, value in row.items() if name != "seconds"}
            for row in csv.DictReader(file)
        ]


class Cluster:
    """A Dask cluster whose scheduler and workers are processes of their own, and may be killed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = int(free.getsockname()[1])
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []

    def revive(self) -> None:
        """Starts the scheduler and the workers that do not run, and waits for the scheduler."""
        dask, quiet = [sys.executable, "-m", "dask"], ["--no-dashboard"]
        if self.scheduler is None or self.scheduler.poll() is not None:
            place = ["--host", "127.0.0.1", "--port", str(self.port)]
            self.scheduler = start([*dask, "scheduler", *place, *quiet], self._folder / "dask")
            stop(self.workers)
        while True:
            with socket.socket() as attempt:
                if attempt.connect_ex(("127.0.0.1", self.port)) == 0:
                    break
            time.sleep(0.1)
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < WORKERS:
            own = ["--nthreads", "1", "--local-directory", str(self._folder)]
            worker = [*dask, "worker", f"tcp://127.0.0.1:{self.port}", *own, *quiet]
            self.workers.append(start(worker, self._folder / "dask"))


def stop(processes: "list[subprocess.Popen[bytes]]") -> None:
    """Kills processes with all that they have started."""
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    """Yields a Dask cluster that is started by ``revive``, and kills it at the end."""
    own = Cluster(folder)
    try:
        yield own
    finally:
        stop([*own.workers, *([own.scheduler] if own.scheduler else [])])


def options(name: str, own: Cluster) -> list[str]:
    """Returns the options of the command for an executor; the cluster is started if it is used."""
    if name == "dask":
        own.revive()
        return ["--executor", "dask", "--scheduler", f"127.0.0.1:{own.port}"]
    return ["--workers", str(WORKERS)]


def kill(victim: str, name: str, driver: "subprocess.Popen[bytes]", own: Cluster) -> bool:
    """Kills a process by SIGKILL; returns whether there was one."""
    if victim == "driver":
        driver.kill()
        return True
    if victim == "scheduler" and own.scheduler is not None:
        own.scheduler.kill()
        own.scheduler.wait()
        return True
    # A worker of Dask is a child of its nanny.
    parents = [worker.pid for worker in own.workers] if name == "dask" else [driver.pid]
    found = [child for parent in parents for child in children(parent)]
    if found:
        os.kill(found[0], signal.SIGKILL)
    return bool(found)


def children(parent: int) -> list[int]:
    """Returns the worker processes that the threads of a process have started (Linux)."""
    found: list[int] = []
    for path in Path(f"/proc/{parent}/task").glob("*/children"):
        try:
            found += [
                child
                for child in map(int, path.read_text().split())
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
            ]
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


if __name__ == "__main__":
    main()
