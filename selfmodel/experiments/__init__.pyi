from .api import (
    calibrate as calibrate,
    diagnose as diagnose,
    evolve_controller as evolve_controller,
    recover as recover,
    replay as replay,
    run_trial as run_trial,
)
from .arguments import load_robot as load_robot, parse_hypothesis as parse_hypothesis
from .comparison.loaded_study import LoadedStudy as LoadedStudy, load as load
from .grid import (
    Cell as Cell,
    Workers as Workers,
    finished as finished,
    processes as processes,
    run_grid as run_grid,
)
from .reality import draw_reality as draw_reality, simulated_robot as simulated_robot
