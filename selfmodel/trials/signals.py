"""The signals of a run, and the names of their columns."""

from dataclasses import dataclass
from typing import Literal, get_args

Signal = Literal[
    "sensors",
    "commands",
    "joint_positions",
    "joint_velocities",
    "joint_efforts",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
]


SIGNALS: tuple[Signal, ...] = get_args(Signal)
"""Every signal of a run, in the order of the trial log.

``sensors``: the readings that the controller received (touch 0 or 1, angles scaled to the joint's
range). ``commands``: actuator controls, each in its own unit: a position servo's target, rad.
``joint_positions``: rad. ``joint_velocities``: rad/s.
``joint_efforts``: torque at the joint over the last physics step, N m; 0 at the start.
``base_position``: root body, world frame, m. ``base_orientation``: unit quaternion, w x y z.
``base_linear_velocity``: world frame, m/s. ``base_angular_velocity``: body frame, rad/s.
"""


@dataclass(frozen=True)
class Names:
    """Column names of the signals of a behaviour.

    Attributes:
        sensors: Inputs of the controller, in its order.
        motors: Outputs of the controller, in its order.
        hinges: Hinge joints of the model, in its order.
    """

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    hinges: tuple[str, ...]

    def width(self, signal: Signal) -> int:
        """Returns the number of columns of a signal."""
        return len(self.columns(signal))

    def columns(self, signal: Signal) -> tuple[str, ...]:
        """Returns the column names of a signal."""
        return {
            "sensors": self.sensors,
            "commands": self.motors,
            "joint_positions": self.hinges,
            "joint_velocities": self.hinges,
            "joint_efforts": self.hinges,
            "base_orientation": ("w", "x", "y", "z"),
        }.get(signal, ("x", "y", "z"))
