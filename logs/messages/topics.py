"""Topics of a log: the signals that each carries, and its message layout."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.messages.cdr import Layout, Template
from selfmodel.trials.signals import Names, Signal

WORLD = "world"

DESCRIPTION = "/robot_description"
TRANSFORMS = "/tf"
DESCRIPTION_TYPE = "std_msgs/msg/String"
TRANSFORMS_TYPE = "tf2_msgs/msg/TFMessage"

FRAMES_PERIOD = 0.05
"""Period of ``/tf``, s: at every step, this topic for display would be a fifth of a log."""

Derived = Literal["child_linear_velocity", "transforms"]
"""Quantities for other tools, which the reader ignores: the velocity of the base in its own frame,
``(steps, 3)`` m/s; position and quaternion (x y z w) of each body in its parent's frame,
``(steps, 7 bodies)``."""

Part = Signal | Derived | Literal["timing"]
"""Quantity in a message. ``timing`` is ``(steps, 3)``: elapsed time in s, and 1 or 0 for a late
step and for a missing observation."""

_XYZW = (1, 2, 3, 0)  # index in MuJoCo's quaternion of each element of a message's


@dataclass(frozen=True)
class Topic:
    """Topic of a trial's log.

    Attributes:
        name: Name of the topic, such as ``/odom``.
        type: Message type.
        template: Message layout.
        parts: Quantities in a message with their widths, in order.
    """

    name: str
    type: str
    template: Template
    parts: tuple[tuple[Part, int], ...]

    def pack(self, rows: Mapping[Part, FloatArray]) -> FloatArray:
        """Returns the numbers of the messages, ``(steps, width)``."""
        return np.concatenate([rows[part][:, _order(part, width)] for part, width in self.parts], 1)

    def unpack(self, values: FloatArray) -> dict[Part, FloatArray]:
        """Returns the parts of the numbers, ``(steps, ...)`` each; the inverse of ``pack``."""
        rows: dict[Part, FloatArray] = {}
        start = 0
        for part, width in self.parts:
            rows[part] = np.empty((len(values), width))
            rows[part][:, _order(part, width)] = values[:, start : start + width]
            start += width
        return rows


def topics(names: Names, root: str) -> tuple[Topic, ...]:
    """Returns the topics that a behaviour is read from.

    ``/odom`` contains the velocity of the base in the frame of the base, as its type requires.
    Rotating back would change the last bits, so the behaviour is read from
    ``/base_linear_velocity``, which contains the velocity in the world frame.

    Args:
        names: Columns of the behaviour's signals.
        root: Name of the root body, the child frame of ``/odom``.
    """
    hinges = len(names.hinges)
    return (
        Topic(
            "/joint_states",
            "sensor_msgs/msg/JointState",
            _joint_state(names.hinges, (hinges, hinges, hinges)),
            (
                ("joint_positions", hinges),
                ("joint_velocities", hinges),
                ("joint_efforts", hinges),
            ),
        ),
        Topic(
            "/joint_commands",
            "sensor_msgs/msg/JointState",
            _joint_state(names.motors, (len(names.motors), 0, 0)),
            (("commands", len(names.motors)),),
        ),
        Topic(
            "/sensors",
            "selfmodel_msgs/msg/SensorReadings",
            _joint_state(names.sensors, (len(names.sensors),)),
            (("sensors", len(names.sensors)),),
        ),
        Topic(
            "/odom",
            "nav_msgs/msg/Odometry",
            _odometry(root),
            (
                ("base_position", 3),
                ("base_orientation", 4),
                ("child_linear_velocity", 3),
                ("base_angular_velocity", 3),
            ),
        ),
        Topic(
            "/base_linear_velocity",
            "geometry_msgs/msg/Vector3Stamped",
            _vector(),
            (("base_linear_velocity", 3),),
        ),
    )


def transforms(bodies: Sequence[str], parents: Sequence[str]) -> Topic:
    """Returns the topic of the poses of all bodies, for other tools.

    Args:
        bodies: Names of the bodies' frames.
        parents: Names of their parents' frames.
    """
    layout = Layout()
    layout.length(len(bodies))
    for body, parent in zip(bodies, parents, strict=True):
        layout.header(parent)
        layout.string(body)
        layout.floats(7)
    parts: tuple[tuple[Part, int], ...] = (("transforms", 7 * len(bodies)),)
    return Topic(TRANSFORMS, TRANSFORMS_TYPE, layout.template(), parts)


def frames_stride(control_timestep: float) -> int:
    """Returns the number of control steps between two messages on ``/tf``."""
    return max(1, round(FRAMES_PERIOD / control_timestep))


def description(text: str) -> bytes:
    """Returns the message on ``/robot_description``."""
    layout = Layout()
    layout.string(text)
    return layout.template().payload


def _order(part: Part, width: int) -> Sequence[int]:
    return _XYZW if part == "base_orientation" else range(width)


def _joint_state(names: Sequence[str], sequences: Sequence[int]) -> Template:
    """Header, names, and sequences of numbers: JointState, and SensorReadings."""
    layout = Layout()
    layout.header("")
    layout.strings(names)
    for count in sequences:
        layout.sequence(count)
    return layout.template()


def _odometry(root: str) -> Template:
    layout = Layout()
    layout.header(WORLD)
    layout.string(root)
    layout.floats(7)
    layout.zeros(36)  # covariance: unknown
    layout.floats(6)
    layout.zeros(36)
    return layout.template()


def _vector() -> Template:
    layout = Layout()
    layout.header(WORLD)
    layout.floats(3)
    return layout.template()


TIMING = Topic(
    "/timing",
    "selfmodel_msgs/msg/SensorReadings",
    _joint_state(("elapsed", "late", "missing"), (3,)),
    (("timing", 3),),
)
"""Measured timing of the steps, on a robot with its own clock."""
