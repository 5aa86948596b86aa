from .cells import Cell as Cell, FinishedCell as FinishedCell, finished as finished
from .definition import read_study as read_study
from .experiment import draw_reality as draw_reality
from .grid import dask_executor as dask_executor, run_grid as run_grid
from .plans import ablation as ablation, paper as paper, suite as suite
from .rows import LoadedStudy as LoadedStudy, load as load
from .study import Study as Study, points_of as points_of
from .training import TrainingSettings as TrainingSettings, evolve_policy as evolve_policy
