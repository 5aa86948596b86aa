from .comparison.loaded_study import LoadedStudy as LoadedStudy, load as load
from .grid import (
    Cell as Cell,
    Workers as Workers,
    finished as finished,
    processes as processes,
    run_grid as run_grid,
)
