from .calibration import Calibration as Calibration, calibrate as calibrate
from .requests import (
    ClosedLoop as ClosedLoop,
    Ensemble as Ensemble,
    Request as Request,
    Segments as Segments,
)
from .rollout import SimulationResult as SimulationResult, SimulationStats as SimulationStats
from .simulator import Simulator as Simulator
from .trial_replay import Replay as Replay, replay as replay
