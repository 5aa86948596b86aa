"""Runs an ablation: first the gaits, then the runs that take them."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from selfmodel.experiments.ablation import bank
from selfmodel.experiments.ablation.plan import Ablation, cells, check, job, spec
from selfmodel.experiments.ablation.rows import as_objects
from selfmodel.experiments.ablation.run_one import run_one
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, run_grid


def ablate(
    ablation: Ablation,
    *,
    workers: int,
    on_event: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Runs what has not been run yet, and returns what failed.

    Args:
        ablation: What to run.
        workers: Processes at a time, each with one thread of physics.
        on_event: Is told what happens, of the gaits' grid and then of the runs'.
        only: ``(i, n)``: of every n runs the i-th, from 1, for a cluster of n machines.

    Raises:
        InputError: Something about it is wrong, or its folder holds another.
    """
    check(ablation)
    chosen = cells(ablation, only)
    no_gait = bank.fill(ablation, chosen, workers, on_event)
    gaits = bank.folder(ablation)
    jobs = [
        job(ablation, cell, digests)
        for cell in chosen
        if (digests := bank.digests(gaits, cell, ablation.settings)) is not None
    ]
    failed = run_grid(
        ablation.folder / "runs", jobs, partial(_rows, gaits), workers=workers, on_event=on_event
    )
    return no_gait + failed


def _rows(gaits: Path, of: Job, comparator: str, folder: Path) -> Any:  # noqa: ANN401  # JSON
    return as_objects(run_one(spec(of), comparator, folder, gaits))
