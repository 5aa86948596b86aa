"""Which topic of a log carries which signals of a behaviour, and in what message."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.cdr import Layout, Template
from selfmodel.trials.behaviour import Names, Signal

WORLD = "world"

DESCRIPTION = "/robot_description"
TRANSFORMS = "/tf"
DESCRIPTION_TYPE = "std_msgs/msg/String"

FRAMES_PERIOD = 0.05
"""Seconds between two messages on ``/tf``: it is for eyes, and would be a fifth of a log."""

Derived = Literal["child_linear_velocity", "transforms"]
"""What a log holds for other tools and the reader leaves alone: the base's velocity in its own
frame, ``(steps, 3)`` m/s; each body's position and orientation (x y z w) in its parent's frame,
``(steps, 7 bodies)``."""

Part = Signal | Derived | Literal["timing"]
"""What the numbers of a message are. ``timing`` is ``(steps, 3)``: the seconds that had elapsed,
and 1 or 0 for whether the step was late and whether its observation is missing."""

_XYZW = (1, 2, 3, 0)  # where a message's quaternion stands in one of MuJoCo


@dataclass(frozen=True)
class Topic:
    """One topic of a trial.

    Attributes:
        name: Such as ``/odom``.
        type: Its messages' type.
        template: Its messages' layout.
        parts: What its numbers are, in order.
    """

    name: str
    type: str
    template: Template
    parts: tuple[tuple[Part, int], ...]

    def pack(self, rows: Mapping[Part, FloatArray]) -> FloatArray:
        """Returns the numbers of its messages, ``(steps, width)``."""
        return np.concatenate([rows[part][:, _order(part, width)] for part, width in self.parts], 1)

    def unpack(self, values: FloatArray) -> dict[Part, FloatArray]:
        """Returns what ``pack`` was given, each part ``(steps, ...)``."""
        rows: dict[Part, FloatArray] = {}
        start = 0
        for part, width in self.parts:
            rows[part] = np.empty((len(values), width))
            rows[part][:, _order(part, width)] = values[:, start : start + width]
            start += width
        return rows


def topics(names: Names, root: str) -> tuple[Topic, ...]:
    """Returns the topics that a behaviour is read from.

    ``/odom`` tells the base's velocity in the base's frame, as its type demands. Rotating it there
    and back would cost its last bits, so ``/base_linear_velocity`` carries the very numbers in the
    world's frame, and those are read.

    Args:
        names: The behaviour's columns.
        root: The body that ``/odom`` tells of.
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
    """Returns the topic that tells other tools where each body is.

    Args:
        bodies: The name of each body's frame.
        parents: The name of the frame that it is told in.
    """
    layout = Layout()
    layout.length(len(bodies))
    for body, parent in zip(bodies, parents, strict=True):
        layout.header(parent)
        layout.string(body)
        layout.floats(7)
    parts: tuple[tuple[Part, int], ...] = (("transforms", 7 * len(bodies)),)
    return Topic(TRANSFORMS, "tf2_msgs/msg/TFMessage", layout.template(), parts)


def frames_stride(control_timestep: float) -> int:
    """Returns how many control steps there are from one message on ``/tf`` to the next."""
    return max(1, round(FRAMES_PERIOD / control_timestep))


def description(text: str) -> bytes:
    """Returns the message of ``/robot_description``."""
    layout = Layout()
    layout.string(text)
    return layout.template().payload


def _order(part: Part, width: int) -> Sequence[int]:
    return _XYZW if part == "base_orientation" else range(width)


def _joint_state(names: Sequence[str], sequences: Sequence[int]) -> Template:
    """A header, names, and sequences of numbers: JointState, and our SensorReadings."""
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
"""When each step really happened, on a robot with a clock of its own."""
