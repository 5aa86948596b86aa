"""Execution of an ablation: a grid of gaits, then a grid of runs."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from selfmodel.experiments.ablation import bank
from selfmodel.experiments.ablation.plan import Ablation, cells, check, job, spec
from selfmodel.experiments.ablation.run_one import files_of, run_one
from selfmodel.experiments.grid import GridBegins, Job, PartEnds, PartResult, run_grid
from selfmodel.experiments.study_files import as_dicts


def ablate(
    ablation: Ablation,
    *,
    workers: int,
    on_progress: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Runs the unfinished parts of an ablation and returns the failed ones.

    Args:
        ablation: The ablation.
        workers: Number of worker processes, each with one thread of physics.
        on_progress: Callback of the grid of gaits, then of the grid of runs.
        only: ``(i, n)``: share i of n of the runs, from 1, for n machines with a folder each.

    Raises:
        InputError: The ablation is invalid, or its folder contains another ablation.
    """
    check(ablation)
    chosen = cells(ablation, only)
    no_gait = bank.fill(ablation, chosen, workers, on_progress)
    gaits = bank.folder(ablation)
    jobs = [
        job(ablation, cell, digests)
        for cell in chosen
        if (digests := bank.digests(gaits, cell, ablation.settings)) is not None
    ]
    failed = run_grid(
        ablation.folder / "runs",
        jobs,
        partial(_rows, gaits),
        workers=workers,
        on_progress=on_progress,
    )
    return no_gait + failed


def _rows(gaits: Path, of: Job, comparator: str, folder: Path) -> PartResult:
    rows = as_dicts(run_one(spec(of), comparator, folder, gaits))
    return PartResult(rows, files_of(spec(of), comparator, folder))
