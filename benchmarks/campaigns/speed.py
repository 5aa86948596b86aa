"""Speed of worker processes: two over one, and the time that is not that of the cells."""

import time
from pathlib import Path

from benchmarks.campaigns.study import Size, cells_of
from selfmodel.experiments.grid import GridBegins, PartEnds, processes, run_grid


def measure(size: Size, folder: Path) -> dict[str, float]:
    """Returns wall times of the study with one and with two workers, and their ratios.

    ``overhead`` is the wall time with one worker over the time of the cells, less 1: starts of the
    worker, reading and writing of cells, and the order of them.

    Args:
        size: Size of the study.
        folder: New folder for both studies.
    """
    wall, work = {}, {}
    for workers in (1, 2):
        out, ends = folder / f"workers-{workers}", list[PartEnds]()

        def note(event: GridBegins | PartEnds, ends: list[PartEnds] = ends) -> None:
            ends.extend([event] if isinstance(event, PartEnds) else [])

        wanted = cells_of(size, out)
        begin = time.perf_counter()
        failed = run_grid(out, wanted, workers=processes(workers), on_progress=note)
        wall[workers] = time.perf_counter() - begin
        work[workers] = sum(end.seconds for end in ends)
        if failed:
            raise SystemExit(f"a cell failed: {failed[0].error}")
    return {
        "cells": len(ends),
        "seconds_with_one": wall[1],
        "seconds_with_two": wall[2],
        "two_over_one": wall[1] / wall[2],
        "overhead": wall[1] / work[1] - 1,
    }
