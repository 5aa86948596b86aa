"""Grid of independent runs in worker processes, resumable from its folder."""

from selfmodel.experiments.grid.definition import check_shared, difference
from selfmodel.experiments.grid.grid import GridBegins, PartEnds, run_grid
from selfmodel.experiments.grid.job import Job, Work
from selfmodel.experiments.grid.parts import FinishedPart, PartResult, finished

__all__ = [
    "FinishedPart",
    "GridBegins",
    "Job",
    "PartEnds",
    "PartResult",
    "Work",
    "check_shared",
    "difference",
    "finished",
    "run_grid",
]
