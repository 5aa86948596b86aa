"""Grid of independent cells, computed by any executor, resumable from its folder."""

from selfmodel.experiments.grid.cell import Cell, Work
from selfmodel.experiments.grid.cell_file import FinishedPart, finished
from selfmodel.experiments.grid.checks import check_runs, difference
from selfmodel.experiments.grid.grid import GridBegins, PartEnds, run_grid
from selfmodel.experiments.grid.process_workers import processes
from selfmodel.experiments.grid.workers import OpenWorkers, Workers

__all__ = [
    "Cell",
    "FinishedPart",
    "GridBegins",
    "OpenWorkers",
    "PartEnds",
    "Work",
    "Workers",
    "check_runs",
    "difference",
    "finished",
    "processes",
    "run_grid",
]
