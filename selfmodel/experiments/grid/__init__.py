"""Grid of independent runs in worker processes, resumable from its folder."""

from selfmodel.experiments.grid.folder import FinishedPart, check_shared, difference, finished
from selfmodel.experiments.grid.grid import GridBegins, Job, PartEnds, Work, run_grid

__all__ = [
    "FinishedPart",
    "GridBegins",
    "Job",
    "PartEnds",
    "Work",
    "check_shared",
    "difference",
    "finished",
    "run_grid",
]
