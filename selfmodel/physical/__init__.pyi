from .environment import EnvironmentRobot as EnvironmentRobot
from .gap import draw_gap as draw_gap
from .interface import PhysicalRobot as PhysicalRobot, TimedRobot as TimedRobot
from .safety import (
    Limit as Limit,
    joint_limits as joint_limits,
    tilt_limit as tilt_limit,
)
from .simulated import SimulatedRobot as SimulatedRobot
from .stop_signals import (
    Terminated as Terminated,
    handle_stop_signals as handle_stop_signals,
)
