"""Messages of a log: ROS 2 types in CDR (little-endian), and the signals on each topic.

``DEFINITIONS`` declares each message type once, in ROS's words; the schema in the file, the layout
in bytes, encoder and decoder follow from it. All messages of a topic differ only in their time
stamps and numbers: a message is laid out once, and series are encoded and decoded by copying
columns of bytes. A test compares definitions and bytes with those of rosbags, which is slower.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray
from selfmodel.trials.signals import Names, Signal

IntArray = NDArray[np.int64]

_FIELDS = {
    "builtin_interfaces/Time": "int32 sec, uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp, string frame_id",
    "std_msgs/String": "string data",
    "diagnostic_msgs/DiagnosticArray": (
        "std_msgs/Header header, diagnostic_msgs/DiagnosticStatus[] status"
    ),
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0, byte WARN=1, byte ERROR=2, byte STALE=3, byte level, "
        "string name, string message, string hardware_id, diagnostic_msgs/KeyValue[] values"
    ),
    "diagnostic_msgs/KeyValue": "string key, string value",
    "geometry_msgs/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position, geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose, float64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear, geometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist, float64[36] covariance",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation, geometry_msgs/Quaternion rotation"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header, string child_frame_id, geometry_msgs/Transform transform"
    ),
    "geometry_msgs/Vector3Stamped": "std_msgs/Header header, geometry_msgs/Vector3 vector",
    "nav_msgs/Odometry": (
        "std_msgs/Header header, string child_frame_id, "
        "geometry_msgs/PoseWithCovariance pose, geometry_msgs/TwistWithCovariance twist"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header, "
        "geometry_msgs/Quaternion orientation, float64[9] orientation_covariance, "
        "geometry_msgs/Vector3 angular_velocity, float64[9] angular_velocity_covariance, "
        "geometry_msgs/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance"
    ),
    "selfmodel_msgs/SensorReadings": "std_msgs/Header header, string[] name, float64[] value",
    "sensor_msgs/JointState": (
        "std_msgs/Header header, string[] name, "
        "float64[] position, float64[] velocity, float64[] effort"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}
DEFINITIONS: Mapping[str, str] = {
    kind: fields.replace(", ", "\n") + "\n" for kind, fields in _FIELDS.items()
}
"""Lines of each message type in ROS; only those of ``selfmodel_msgs`` are selfmodel's own."""

_ENCAPSULATION = b"\x00\x01\x00\x00"
_BILLION = 1_000_000_000


def is_known(kind: str) -> bool:
    """Returns whether a message type is one of those that selfmodel writes."""
    return kind.replace("/msg/", "/") in DEFINITIONS


def schema_text(kind: str) -> str:
    """Returns the definition of a message type, with the definitions of all nested types."""
    short = kind.replace("/msg/", "/")
    nested = [f"MSG: {part}\n{DEFINITIONS[part]}" for part in _nested(short)]
    return f"{'=' * 80}\n".join([DEFINITIONS[short], *nested])


def _nested(short: str) -> list[str]:
    """Nested types of a message type, depth first, without duplicates."""
    types = [field.partition("[")[0] for field, _ in _fields_of(short)]
    return list(
        dict.fromkeys(
            part for kind in types if kind in DEFINITIONS for part in (kind, *_nested(kind))
        )
    )


def _fields_of(short: str) -> list[tuple[str, str]]:
    """Types and names of the fields of a message type; a constant is none."""
    lines = [line.split(" ") for line in DEFINITIONS[short].splitlines()]
    return [(field, name) for field, name in lines if "=" not in name]


# ---------------------------------------------------------------- layout in bytes


class Template:
    """Bytes of a message with gaps for its time stamps and its numbers.

    Args:
        kind: Message type, such as ``sensor_msgs/msg/JointState``.
        content: Texts, bytes, lists of texts and of messages, and lengths of sequences of numbers,
            by field; a text is empty and a sequence has no numbers unless given. Arrays of fixed
            length, which are covariances, are zeros after the first number; all other numbers are
            gaps.

    Attributes:
        payload: Message with zeros in the gaps.
    """

    def __init__(self, kind: str, content: Mapping[str, Any]) -> None:
        self._bytes = bytearray(_ENCAPSULATION)
        self._stamps: list[int] = []
        self._blocks: list[tuple[int, int]] = []
        self._add(kind.replace("/msg/", "/"), content)
        self.payload = bytes(self._bytes)

    def _add(self, kind: str, value: Any) -> None:  # noqa: ANN401  # see the class
        match kind:
            case "builtin_interfaces/Time":
                self._stamps.append(self._reserve(4, 8))
            case "string":
                data = (value or "").encode() + b"\x00"
                self._length(len(data))
                self._bytes += data
            case "byte":
                self._bytes.append(value)
            case "float64":
                self._gap(1)
            case "float64[]":
                self._length(value or 0)
                self._gap(value or 0)
            case "float64[9]" | "float64[36]":
                self._gap(1)
                self._reserve(8, 8 * (int(kind[8:-1]) - 1))
            case _ if kind.endswith("[]"):
                self._length(len(value))
                for item in value:
                    self._add(kind.removesuffix("[]"), item)
            case _:
                for field, name in _fields_of(kind):
                    self._add(field, (value or {}).get(name))

    def _reserve(self, alignment: int, size: int) -> int:
        """Adds zeros, and returns their offset."""
        self._bytes += bytes(-(len(self._bytes) - len(_ENCAPSULATION)) % alignment)
        offset = len(self._bytes)
        self._bytes += bytes(size)
        return offset

    def _length(self, count: int) -> None:
        struct.pack_into("<I", self._bytes, self._reserve(4, 4), count)

    def _gap(self, count: int) -> None:
        if count:
            offset = self._reserve(8, 8 * count)
            if self._blocks and self._blocks[-1][0] + 8 * self._blocks[-1][1] == offset:
                offset, before = self._blocks.pop()  # adjacent numbers are copied at once
                count += before
            self._blocks.append((offset, count))

    def encode(self, nanoseconds: IntArray, values: FloatArray) -> list[bytes]:
        """Returns one message per row of values, ``(steps, width)``.

        Each has its time, ``(steps,)`` ns, not negative, in all its stamps.
        """
        messages = np.tile(np.frombuffer(self.payload, np.uint8), (len(values), 1))
        seconds = np.column_stack(np.divmod(nanoseconds, _BILLION))
        stamp_bytes = np.ascontiguousarray(seconds, dtype="<u4").view(np.uint8)
        for offset in self._stamps:
            messages[:, offset : offset + 8] = stamp_bytes
        value_bytes = np.ascontiguousarray(values, dtype="<f8").view(np.uint8)
        start = 0
        for offset, count in self._blocks:
            messages[:, offset : offset + 8 * count] = value_bytes[:, start : start + 8 * count]
            start += 8 * count
        return [row.tobytes() for row in messages]

    def decode(self, payloads: Sequence[bytes]) -> tuple[IntArray, FloatArray]:
        """Returns the times and numbers of messages; the inverse of ``encode``."""
        length = len(self.payload)
        for index, payload in enumerate(payloads):
            if len(payload) != length:
                raise ValueError(
                    f"message {index} has {len(payload)} bytes where the first has {length}"
                )
        messages = np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, length)
        fixed = np.ones(length, dtype=np.bool_)
        for offset, count in (*((stamp, 1) for stamp in self._stamps), *self._blocks):
            fixed[offset : offset + 8 * count] = False
        wrong = np.any(messages[:, fixed] != np.frombuffer(self.payload, np.uint8)[fixed], axis=1)
        if np.any(wrong):
            raise ValueError(f"message {np.argmax(wrong)} has another layout than expected")

        def numbers(offset: int, size: int, dtype: str) -> NDArray[np.generic]:
            return np.ascontiguousarray(messages[:, offset : offset + size]).view(dtype)

        stamps = [numbers(offset, 8, "<u4").astype(np.int64) for offset in self._stamps]
        if any(np.any(other != stamps[0]) for other in stamps[1:]):
            raise ValueError("the time stamps within a message differ")
        blocks = [numbers(offset, 8 * count, "<f8") for offset, count in self._blocks]
        none: FloatArray = np.empty((len(messages), 0))  # for a robot without sensors
        values = np.concatenate([none, *blocks], axis=1).astype(np.float64, copy=False)
        return stamps[0][:, 0] * _BILLION + stamps[0][:, 1], values


def names_in(payload: bytes) -> tuple[str, ...]:
    """Returns the names in a message that begins with a header and a ``string[] name``."""
    if payload[:4] != _ENCAPSULATION:
        raise ValueError(f"expected little-endian CDR (00 01 00 00), got {payload[:4].hex(' ')!r}")
    at = len(_ENCAPSULATION) + 8

    def length() -> int:
        nonlocal at
        at += -(at - len(_ENCAPSULATION)) % 4 + 4
        if at > len(payload):
            raise ValueError(f"a message of {len(payload)} bytes ends within its names")
        return int.from_bytes(payload[at - 4 : at], "little")

    def text() -> str:
        nonlocal at
        size = length()
        if not 0 < size <= len(payload) - at:
            raise ValueError(f"a name of {size} bytes in a message of {len(payload)} bytes")
        at += size
        return payload[at - size : at - 1].decode()

    text()  # the frame
    return tuple(text() for _ in range(length()))  # a wrong count ends with the payload


# ---------------------------------------------------------------- topics

WORLD = "world"
DESCRIPTION = "/robot_description"
DESCRIPTION_TYPE = "std_msgs/msg/String"
TRANSFORMS = "/tf"
COMMANDS = "/joint_commands"
IMU = "/imu"

CHANNELS: Mapping[str, Mapping[str, str]] = {
    DESCRIPTION: {
        "offered_qos_profiles": "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
        "  deadline: {sec: 0, nsec: 0}\n  lifespan: {sec: 0, nsec: 0}\n  liveliness: 1\n"
        "  liveliness_lease_duration: {sec: 0, nsec: 0}\n"
        "  avoid_ros_namespace_conventions: false"
    }
}
"""Metadata of channels by topic. A player of ROS 2 keeps the description for who subscribes later:
the last one (history 1, depth 1), reliable (1) and transient local (durability 1)."""

FRAMES_PERIOD = 0.05
"""Period of ``/tf``, s: at every step, this topic for display would be a fifth of a log."""

Derived = Literal[
    "child_linear_velocity",
    "pose_unknown",
    "twist_unknown",
    "orientation_unknown",
    "turning_unknown",
    "acceleration_unknown",
    "transforms",
]
"""Quantities for other tools, which the reader ignores: the velocity of the base in its own frame,
``(steps, 3)`` m/s; the first number of a covariance, such as of the base's pose and twist, -1 if
some of it is not known and otherwise 0, ``(steps, 1)``; position and quaternion (x y z w) of each
body in its parent's frame, ``(steps, 7 bodies)``."""

Part = Signal | Derived | Literal["acceleration", "timing"]
"""Quantity in a message. ``acceleration`` is what an accelerometer of the base measures, gravity
included, ``(steps, 3)`` m/s^2. ``timing`` is ``(steps, 3)``: elapsed time in s, and 1 or 0 for a
late step and for a missing observation."""

XYZW = (1, 2, 3, 0)  # index in MuJoCo's quaternion of each element of a message's


class Topic:
    """Topic of a trial's log: message type, fixed content (see ``Template``), widths of parts."""

    def __init__(self, name: str, kind: str, content: Mapping[str, Any], **parts: int) -> None:
        self.name, self.type = name, kind
        self.template = Template(kind, content)
        self.parts: Mapping[Part, int] = parts  # type: ignore[assignment]  # names of parts

    def pack(self, rows: Mapping[Part, FloatArray]) -> FloatArray:
        """Returns the numbers of the messages, ``(steps, width)``."""
        parts = [rows[part][:, _order(part, width)] for part, width in self.parts.items()]
        return np.concatenate(parts, axis=1)

    def unpack(self, values: FloatArray) -> dict[Part, FloatArray]:
        """Returns the parts of the numbers, ``(steps, ...)`` each; the inverse of ``pack``."""
        rows: dict[Part, FloatArray] = {}
        start = 0
        for part, width in self.parts.items():
            rows[part] = np.empty((len(values), width))
            rows[part][:, _order(part, width)] = values[:, start : start + width]
            start += width
        return rows


def _order(part: Part, width: int) -> Sequence[int]:
    return XYZW if part == "base_orientation" else range(width)


def topics(
    names: Names, root: str, *, timed: bool = False, driven: Sequence[str] = ()
) -> tuple[Topic, ...]:
    """Returns the topics that a trajectory is read from.

    ``/odom`` contains the velocity of the base in the frame of the base, as its type requires.
    Rotating back would change the last bits, so the trajectory is read from
    ``/base_linear_velocity``, which contains the velocity in the world frame. The child frame of
    ``/odom`` is the root body. A timed robot has its own clock, and thereby the topic ``TIMING``.
    ``driven`` are names of the motors in the messages, such as of the joints that they drive; by
    default their own.
    """
    hinges, motors, sensors = len(names.hinges), len(names.motors), len(names.sensors)
    state, readings = "sensor_msgs/msg/JointState", "selfmodel_msgs/msg/SensorReadings"
    world = {"frame_id": WORLD}
    return (
        Topic(
            "/joint_states",
            state,
            {"name": names.hinges, "position": hinges, "velocity": hinges, "effort": hinges},
            joint_positions=hinges,
            joint_velocities=hinges,
            joint_efforts=hinges,
        ),
        Topic(
            COMMANDS,
            state,
            {"name": driven or names.motors, "position": motors},
            commands=motors,
        ),
        Topic("/sensors", readings, {"name": names.sensors, "value": sensors}, sensors=sensors),
        Topic(
            "/odom",
            "nav_msgs/msg/Odometry",
            {"header": world, "child_frame_id": root},
            base_position=3,
            base_orientation=4,
            pose_unknown=1,
            child_linear_velocity=3,
            base_angular_velocity=3,
            twist_unknown=1,
        ),
        Topic(
            "/base_linear_velocity",
            "geometry_msgs/msg/Vector3Stamped",
            {"header": world},
            base_linear_velocity=3,
        ),
        *([TIMING] if timed else []),
    )


TIMING = Topic(
    "/timing",
    "selfmodel_msgs/msg/SensorReadings",
    {"name": ("elapsed", "late", "missing"), "value": 3},
    timing=3,
)
"""Measured timing of the steps, on a robot with its own clock."""


def imu(root: str) -> Topic:
    """Returns the topic of the IMU of an imported recording, in the frame of the root body."""
    return Topic(
        IMU,
        "sensor_msgs/msg/Imu",
        {"header": {"frame_id": root}},
        base_orientation=4,
        orientation_unknown=1,
        base_angular_velocity=3,
        turning_unknown=1,
        acceleration=3,
        acceleration_unknown=1,
    )


def transforms(bodies: Sequence[str], parents: Sequence[str]) -> Topic:
    """Returns the topic of the poses of all bodies, by their frames and those of the parents."""
    content = [
        {"header": {"frame_id": parent}, "child_frame_id": body}
        for body, parent in zip(bodies, parents, strict=True)
    ]
    kind = "tf2_msgs/msg/TFMessage"
    return Topic(TRANSFORMS, kind, {"transforms": content}, transforms=7 * len(bodies))


def description(text: str) -> bytes:
    """Returns the message on ``/robot_description``."""
    return Template(DESCRIPTION_TYPE, {"data": text}).payload
