from .environment import EnvironmentRobot as EnvironmentRobot
from .interface import (
    Limit as Limit,
    ObservedRobot as ObservedRobot,
    PhysicalRobot as PhysicalRobot,
    TimedRobot as TimedRobot,
    joint_limits as joint_limits,
    tilt_limit as tilt_limit,
)
from .safety import Terminated as Terminated, handle_stop_signals as handle_stop_signals
from .simulated import SimulatedRobot as SimulatedRobot, draw_gap as draw_gap
