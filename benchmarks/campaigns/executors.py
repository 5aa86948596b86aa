"""Executors on this machine: processes, a Dask cluster of two workers, submitit's local jobs."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.campaigns.study import start

WORKERS = 2
NAMES = ("processes", "dask", "slurm")


class Cluster:
    """A Dask cluster whose scheduler and workers are processes of their own, and may be killed.

    Args:
        folder: Folder of the cluster's files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{free.getsockname()[1]}"
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []

    def revive(self) -> None:
        """Starts the scheduler and the workers that do not run, and waits for the scheduler."""
        host, port = self.address.split(":")
        dask = [sys.executable, "-m", "dask"]
        if self.scheduler is None or self.scheduler.poll() is not None:
            options = ["--host", host, "--port", port, "--no-dashboard"]
            self.scheduler = start([*dask, "scheduler", *options], self._folder / "stderr")
            self.stop(self.workers)
        while True:
            with socket.socket() as attempt:
                if attempt.connect_ex((host, int(port))) == 0:
                    break
            time.sleep(0.1)
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < WORKERS:
            options = ["--nthreads", "1", "--no-dashboard", "--local-directory", str(self._folder)]
            worker = [*dask, "worker", f"tcp://{self.address}", *options]
            self.workers.append(start(worker, self._folder / "stderr"))

    def stop(self, processes: list[subprocess.Popen[bytes]]) -> None:
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
        own.stop([*own.workers, *([own.scheduler] if own.scheduler else [])])


def options(name: str, own: Cluster) -> list[str]:
    """Returns the options of the command for an executor; the cluster is started if it is used."""
    if name == "dask":
        own.revive()
        return ["--executor", f"dask://{own.address}"]
    if name == "slurm":
        local = "cluster=local,timeout=02:00:00"
        return ["--executor", "slurm", "--executor-option", local, "--workers", str(WORKERS)]
    return ["--workers", str(WORKERS)]
