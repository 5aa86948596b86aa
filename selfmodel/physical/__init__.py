"""Physical robots: the interface, a simulated one with a reality gap, any dm_env environment."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.physical.environment_robot import EnvironmentRobot as EnvironmentRobot
    from selfmodel.physical.interface import (
        PhysicalRobot as PhysicalRobot,
        TimedRobot as TimedRobot,
    )
    from selfmodel.physical.reality_gap import draw_gap as draw_gap
    from selfmodel.physical.safety_limits import (
        Limit as Limit,
        joint_limits as joint_limits,
        tilt_limit as tilt_limit,
    )
    from selfmodel.physical.simulated_robot import SimulatedRobot as SimulatedRobot
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "environment_robot": ["EnvironmentRobot"],
            "interface": ["PhysicalRobot", "TimedRobot"],
            "reality_gap": ["draw_gap"],
            "safety_limits": ["Limit", "joint_limits", "tilt_limit"],
            "simulated_robot": ["SimulatedRobot"],
        },
    )
