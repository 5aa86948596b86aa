"""Kills of anything on the way of one study, which is continued with another executor each time."""

import os
import signal
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.campaigns.executors import NAMES, Cluster, cluster, options
from benchmarks.campaigns.study import Size, command, start

VICTIMS = ("driver", "worker", "scheduler")


def kill_on_the_way(
    size: Size, folder: Path, count: int, pause: tuple[float, float], seed: int
) -> dict[str, object]:
    """Runs a study to its end with kills on the way, and returns what was done twice.

    A driver ends with another status than 0 if it was killed, or if its scheduler was; after the
    kill of a worker, any other status is unexpected.

    Args:
        size: Size of the study.
        folder: New folder; the study is in its folder ``out``.
        count: Number of kills.
        pause: Shortest and longest time between kills, s.
        seed: Seed of the executors, victims and moments.
    """
    rng, kills = np.random.default_rng(seed), Counter[str]()
    unexpected: list[str] = []
    folder.mkdir(parents=True)
    out, errors = folder / "out", folder / "stderr"
    with cluster(folder / "dask") as own, _begun(out / "unfinished") as begun:
        while sum(kills.values()) < count:
            name = str(rng.choice(NAMES))
            driver = start(command(size, out, *options(name, own)), errors)
            victim, expected = "", {0}
            while sum(kills.values()) < count and driver.poll() is None:
                time.sleep(rng.uniform(*pause))
                victim = str(rng.choice(VICTIMS[: 3 if name == "dask" else 2]))
                if driver.poll() is None and _kill(victim, name, driver, own):
                    kills[f"{name} {victim}"] += 1
                    print(f"{sum(kills.values())}: {name}, {victim}", flush=True)
                    if victim != "worker":
                        expected = {0, -signal.SIGKILL} if victim == "driver" else {0, 1}
                        driver.wait()
                if name == "dask" and driver.poll() is None:
                    own.revive()
            status = driver.wait()
            if status not in expected:
                end = errors.read_text().strip().splitlines()[-1:]
                unexpected.append(f"{name}, after {victim or 'no kill'}: {status}, {end}")
            if status == 0:
                break
        last = start(command(size, out, "--workers", "2"), errors)
        if last.wait():
            raise SystemExit(f"the study did not end: {errors}")
    twice = sum(times - 1 for times in begun.values())
    return {
        "kills": dict(kills),
        "cells": len(begun),
        "computed_twice": twice,
        "unexpected_ends": unexpected,
    }


@contextmanager
def _begun(unfinished: Path) -> Iterator[Counter[str]]:
    """Yields a counter of how often each cell was begun, by its folders in ``unfinished``."""
    seen: set[str] = set()
    begun: Counter[str] = Counter()
    end = threading.Event()

    def watch() -> None:
        while not end.wait(0.02):
            for path in unfinished.glob("*/*"):
                if path.name not in seen and path.suffix != ".old":
                    seen.add(path.name)
                    begun[path.stem] += 1

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield begun
    finally:
        end.set()
        thread.join()


def _kill(victim: str, name: str, driver: subprocess.Popen[bytes], own: Cluster) -> bool:
    """Kills a process by SIGKILL; returns whether there was one."""
    if victim == "driver":
        driver.kill()
        return True
    if victim == "scheduler":
        if own.scheduler is not None:
            own.scheduler.kill()
            own.scheduler.wait()
        return True
    parents = [worker.pid for worker in own.workers] if name == "dask" else [driver.pid]
    # A worker of Dask is a child of its nanny, a job of submitit one of its controller.
    found = [child for parent in parents for child in _children(parent) if _is_worker(child)]
    if name == "slurm":
        found = [job for controller in found for job in _children(controller)]
    if found:
        os.kill(found[0], signal.SIGKILL)
    return bool(found)


def _children(parent: int) -> list[int]:
    """Returns the child processes of all threads of a process (Linux)."""
    found: list[int] = []
    for path in Path(f"/proc/{parent}/task").glob("*/children"):
        try:
            found += map(int, path.read_text().split())
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


def _is_worker(process: int) -> bool:
    try:
        line = Path(f"/proc/{process}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return b"spawn_main" in line or b"submitit" in line
