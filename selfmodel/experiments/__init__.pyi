from .api import (
    calibrate as calibrate,
    diagnose as diagnose,
    evolve_controller as evolve_controller,
    recover as recover,
    replay as replay,
    run_trial as run_trial,
)
from .arguments import load_robot as load_robot, parse_hypothesis as parse_hypothesis
from .grid import (
    Job as Job,
    PartResult as PartResult,
    finished as finished,
    run_grid as run_grid,
)
from .reality import draw_reality as draw_reality, simulated_robot as simulated_robot
