"""Topics of a log: the signals that each carries, its message layout and its definition.

The definitions are those of ROS 2's common interfaces, as rosbags prints them; a test compares
both. Only those of ``selfmodel_msgs`` are definitions of selfmodel.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.cdr import Layout, Template
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


_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
        "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
        "std_msgs/String": "string data\n",
        "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
        "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
        "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
        "geometry_msgs/Pose": (
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
        ),
        "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
        "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
        "geometry_msgs/Transform": (
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
        ),
        "geometry_msgs/TransformStamped": (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
        ),
        "geometry_msgs/Vector3Stamped": "std_msgs/Header header\ngeometry_msgs/Vector3 vector\n",
        "nav_msgs/Odometry": (
            "std_msgs/Header header\nstring child_frame_id\n"
            "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
        ),
        "selfmodel_msgs/SensorReadings": (
            "std_msgs/Header header\nstring[] name\nfloat64[] value\n"
        ),
        "sensor_msgs/JointState": (
            "std_msgs/Header header\nstring[] name\n"
            "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        ),
        "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    }
)


def is_known(name: str) -> bool:
    """Returns whether a message type is one of those in a trial log."""
    return name.replace("/msg/", "/") in _DEFINITIONS


def schema_text(name: str) -> str:
    """Returns the definition of a message type, with the definitions of all nested types.

    Args:
        name: Message type, such as ``sensor_msgs/msg/JointState``.
    """
    short = name.replace("/msg/", "/")
    parts = [_DEFINITIONS[short]]
    parts += [f"MSG: {part}\n{_DEFINITIONS[part]}" for part in _parts(short)]
    return f"{'=' * 80}\n".join(parts)


def _parts(name: str) -> list[str]:
    """Nested types of a message type, depth first, without duplicates."""
    found: dict[str, None] = {}
    for line in _DEFINITIONS[name].splitlines():
        field = line.split(" ")[0].partition("[")[0]
        if field in _DEFINITIONS:
            found.update(dict.fromkeys([field, *_parts(field)]))
    return list(found)
