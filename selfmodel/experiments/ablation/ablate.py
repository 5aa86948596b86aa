"""Execution of an ablation."""

from collections.abc import Callable

from selfmodel.experiments.ablation.plan import Ablation, cells
from selfmodel.experiments.grid import GridBegins, OpenWorkers, PartEnds, run_grid


def ablate(
    ablation: Ablation,
    *,
    workers: OpenWorkers,
    on_progress: Callable[[GridBegins | PartEnds], None],
    only: tuple[int, int] = (1, 1),
) -> tuple[PartEnds, ...]:
    """Computes the unfinished cells of an ablation and returns the failed ones.

    Args:
        ablation: The ablation.
        workers: The workers, each with one thread of physics.
        on_progress: Callback of the grid.
        only: ``(i, n)``: share i of n of the runs, from 1, for n machines with a folder each.

    Raises:
        InputError: The ablation is invalid, or its folder contains another ablation.
    """
    chosen = cells(ablation, only)
    return run_grid(ablation.folder, chosen, workers=workers, on_progress=on_progress)
