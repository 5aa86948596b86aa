"""Executors by name: processes of this machine, jobs of Slurm, a Dask cluster."""

from collections.abc import Mapping
from pathlib import Path

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.grid.dask_workers import dask
from selfmodel.experiments.grid.process_workers import processes
from selfmodel.experiments.grid.slurm_workers import slurm
from selfmodel.experiments.grid.workers import OpenWorkers

PROCESSES, SLURM, DASK = "processes", "slurm", "dask://"
"""Executors by name; that of Dask is followed by the address of a scheduler."""


def choose_workers(
    executor: str, options: Mapping[str, str], count: int, folder: Path
) -> OpenWorkers:
    """Returns workers by the name of their executor.

    Args:
        executor: ``processes``, ``slurm``, or ``dask://HOST:PORT``.
        options: Options of Slurm.
        count: Number of processes, or of jobs of Slurm at a time.
        folder: Folder of the study.

    Raises:
        InputError: The name is unknown, or options are given that only Slurm has.
    """
    if executor == SLURM:
        return slurm(options, count, folder)
    if options:
        raise InputError(
            f"expected --executor-option with --executor {SLURM} alone, got it with {executor}"
        )
    if executor.startswith(DASK):
        return dask(executor.removeprefix(DASK))
    if executor != PROCESSES:
        raise unknown_name("executor", executor, (PROCESSES, SLURM, f"{DASK}HOST:PORT"))
    return processes(count)
