"""Messages of ROS 1 and ROS 2, decoded without ROS into names and rows of numbers."""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import zstandard
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from selfmodel.arrays import FloatArray

JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
ARRAY = "std_msgs/msg/Float64MultiArray"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
IMU = "sensor_msgs/msg/Imu"
WRENCH = "geometry_msgs/msg/WrenchStamped"
NUMBERS = ("std_msgs/msg/Float64", "std_msgs/msg/Float32", "std_msgs/msg/Bool")

TYPES: Mapping[str, tuple[str, ...]] = {
    "joints": (JOINT_STATE,),
    "commands": (JOINT_STATE, ARRAY, TRAJECTORY),
    "base": (ODOMETRY, POSE),
    "imu": (IMU,),
    "touch": (WRENCH, *NUMBERS, ARRAY),
}
"""Message types that can play each role; every other type is a table of the fields that it has."""

MAX_ELEMENTS = 100
"""Length of the longest list in a message whose numbers are columns: an image has none."""

_TIME = "builtin_interfaces/msg/Time"
_NO_POSITION = 2e9
"""Magnitude of Unitree's ``PosStopF``, 2.146e9, by which a motor is commanded no angle."""

Rows = tuple[tuple[str, ...], "FloatArray"]
"""Names in a message, and a row of numbers for each, ``(names, width)``."""

CDR, ROS1 = "cdr", "ros1"
"""Encodings of messages: that of ROS 2 with DDS, and that of ROS 1."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame. A CDR message begins with 0."""


class RefusedError(ValueError):
    """A message contradicts itself; it is counted and left out."""


class UndefinedError(ValueError):
    """Neither the recording nor a distribution of ROS defines a type."""


def decode(
    data: bytes, kind: str, encoding: str, definition: str = "", columns: Collection[str] = ()
) -> tuple[int, Rows]:
    """Returns the time stamp of a message, ns (0 if it has none), and its rows.

    Args:
        data: Encoded message.
        kind: Its type.
        encoding: ``CDR`` or ``ROS1``.
        definition: Text of a type that is not in ``DECODERS`` and of those in it; "" for that of
            ROS or of ``DEFINITIONS``.
        columns: Names of the numbers to return of such a type, of those that it has; or all.

    Raises:
        RefusedError: The message contradicts itself.
        UndefinedError: The type has no definition that can be used.
    """
    if encoding == CDR and data.startswith(ZSTD_MAGIC):
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            data = reader.readall()
    store = _store(encoding) if kind in DECODERS else _store(encoding, kind, definition)
    if store is None:
        raise UndefinedError(kind)
    message: Any = (
        store.deserialize_ros1(data, kind)
        if encoding == ROS1
        else store.deserialize_cdr(data, kind)
    )
    stamp = 0
    stamped: Any = getattr(getattr(message, "header", None), "stamp", None)
    if getattr(stamped, "__msgtype__", "") == _TIME:  # a type of one's own may have any header
        stamp = stamped.sec * 10**9 + stamped.nanosec
    if stamp < 0:
        raise RefusedError("with a stamp before 1970")
    if kind in DECODERS:
        return stamp, DECODERS[kind](message)
    numbers = {name: _number(message, name) for name in columns} or dict(_numbers(message))
    if kind.startswith("unitree_"):
        stopped = [n for n, q in numbers.items() if n.endswith(".q") and abs(q) >= _NO_POSITION]
        numbers |= dict.fromkeys(stopped, math.inf)
    return stamp, (tuple(numbers), np.array([*numbers.values()], dtype=np.float64)[:, np.newaxis])


@cache
def _store(encoding: str, kind: str = "", definition: str = "") -> "Typestore | None":
    """Message types of ROS, which are the same for ``DECODERS`` in all distributions, and a kind.

    There are none of a kind that has no definition, or one that cannot be used.
    """
    store = get_typestore(Stores.ROS1_NOETIC if encoding == ROS1 else Stores.ROS2_HUMBLE)
    if not kind or (kind in store.fielddefs and not definition):
        return store
    try:
        defined = get_types_from_msg(definition or DEFINITIONS[kind], kind)
        if any(map(_is_endless, defined.values())):
            return None
        for name in defined:
            store.fielddefs.pop(name, None)  # of another distribution
        store.register(defined)
        store.get_msgdef(kind)  # of types that are defined, and do not contain themselves
    except (KeyError, TypesysError, RecursionError, SyntaxError):
        return None
    return store


def _is_endless(definition: Any) -> bool:  # noqa: ANN401  # a tree of rosbags
    """Whether a type has a long array of messages, each of which may have no bytes."""
    return any(
        node == Nodetype.ARRAY and about[0][0] == Nodetype.NAME and about[1] > MAX_ELEMENTS
        for _, (node, about) in definition[1]
    )


def text(encoding: str, definition: bytes) -> str:
    """Returns the definition of a message type, if it is in ROS's own language."""
    return definition.decode(errors="replace") if encoding in ("ros2msg", "ros1msg") else ""


def _numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:  # noqa: ANN401
    """Numbers in a message by name, such as ``motor_state[3].q``."""
    if is_dataclass(value):
        for field in fields(value):
            inner = f"{name}.{field.name}" if name else field.name
            yield from _numbers(getattr(value, field.name), inner)
    elif isinstance(value, list | np.ndarray):
        for place, item in enumerate(value if len(value) <= MAX_ELEMENTS else ()):
            yield from _numbers(item, f"{name}[{place}]")
    elif isinstance(value, int | float | np.number | np.bool_):
        yield name, float(value)


def _number(message: Any, name: str) -> float:  # noqa: ANN401
    """Number of that name in a message; NaN in one that has none, as its list is shorter."""
    value = message
    for part in _parts(name):
        try:
            if isinstance(part, int) and len(value) > MAX_ELEMENTS:
                return math.nan
            value = value[part] if isinstance(part, int) else vars(value)[part]
        except (LookupError, TypeError):
            return math.nan
    return float(value) if isinstance(value, int | float | np.number | np.bool_) else math.nan


@cache
def _parts(name: str) -> tuple[str | int, ...]:
    if not re.fullmatch(r"\w+(\.[A-Za-z]\w*|\[(0|[1-9]\d?)\])*", name):
        return (name,)
    return tuple(int(part) if part.isdecimal() else part for part in re.findall(r"\w+", name))


def _named(names: list[str], *columns: "FloatArray") -> Rows:
    """Columns of numbers by name; an empty one is missing."""
    if len(set(names)) != len(names):
        raise RefusedError("with a name twice")
    rows = np.full((len(names), len(columns)), np.nan)
    for column, values in enumerate(columns):
        if len(values) not in (0, len(names)):
            raise RefusedError("with more or fewer numbers than names")
        if len(values):
            rows[:, column] = values
    return tuple(names), rows


def _trajectory(message: Any) -> Rows:  # noqa: ANN401  # a class that rosbags makes
    if not message.points:
        raise RefusedError("without a point")
    positions = message.points[0].positions
    if message.joint_names and not len(positions):
        raise RefusedError("with more or fewer numbers than names")
    return _named(message.joint_names, positions)


def _array(message: Any) -> Rows:  # noqa: ANN401
    return _named([str(column) for column in range(len(message.data))], message.data)


def _one(*numbers: float) -> Rows:
    return ("",), np.array([numbers], dtype=np.float64)


def _imu(message: Any) -> Rows:  # noqa: ANN401
    # REP 145: a first covariance of -1 means no measurement.
    known = message.orientation_covariance[0] != -1
    vectors = (
        (message.angular_velocity, message.angular_velocity_covariance),
        (message.linear_acceleration, message.linear_acceleration_covariance),
    )
    return _one(
        *(_wxyz(message.orientation) if known else [np.nan] * 4),
        *(x for one, of in vectors for x in (_xyz(one) if of[0] != -1 else [np.nan] * 3)),
    )


def _odometry(message: Any) -> Rows:  # noqa: ANN401
    twist = message.twist.twist
    return _one(*_pose(message.pose.pose), *_xyz(twist.linear), *_xyz(twist.angular))


def _pose(pose: Any) -> list[float]:  # noqa: ANN401
    return [*_xyz(pose.position), *_wxyz(pose.orientation)]


def _xyz(vector: Any) -> list[float]:  # noqa: ANN401
    return [vector.x, vector.y, vector.z]


def _wxyz(quaternion: Any) -> list[float]:  # noqa: ANN401
    return [quaternion.w, *_xyz(quaternion)]


DECODERS: Mapping[str, Callable[[Any], Rows]] = {
    JOINT_STATE: lambda m: _named(m.name, m.position, m.velocity, m.effort),
    TRAJECTORY: _trajectory,
    ARRAY: _array,
    ODOMETRY: _odometry,
    POSE: lambda m: _one(*_pose(m.pose), *[np.nan] * 6),
    IMU: _imu,
    WRENCH: lambda m: _one(math.hypot(*_xyz(m.wrench.force))),
    **dict.fromkeys(NUMBERS, lambda m: _one(m.data)),
}
"""Decoders of the supported message types into names and rows of numbers.

Widths: JointState 3 (position, velocity, effort), those of commands 1, Odometry and PoseStamped 13
(position, orientation w x y z, linear and angular velocity in the child's frame), Imu 10
(orientation w x y z, angular velocity, linear acceleration), touch 1. Missing numbers are NaN. The
columns of a Float64MultiArray are named by their index; of types with one column, it has no name.
"""


_FIELDS = {
    "Head": "uint8[2] head, uint8 level_flag, uint8 frame_reserve, uint32[2] sn, "
    "uint32[2] version, uint16 bandwidth",
    "LowState": "IMUState imu_state, MotorState[20] motor_state, BmsState bms_state, "
    "int16[4] foot_force, int16[4] foot_force_est, uint32 tick, uint8[40] wireless_remote, "
    "uint8 bit_flag, float32 adc_reel, int8 temperature_ntc1, int8 temperature_ntc2, "
    "float32 power_v, float32 power_a, uint16[4] fan_frequency, uint32 reserve, uint32 crc",
    "IMUState": "float32[4] quaternion, float32[3] gyroscope, float32[3] accelerometer, "
    "float32[3] rpy, int8 temperature",
    "MotorState": "uint8 mode, float32 q, float32 dq, float32 ddq, float32 tau_est, "
    "float32 q_raw, float32 dq_raw, float32 ddq_raw, int8 temperature, uint32 lost, "
    "uint32[2] reserve",
    "BmsState": "uint8 version_high, uint8 version_low, uint8 status, uint8 soc, int32 current, "
    "uint16 cycle, int8[2] bq_ntc, int8[2] mcu_ntc, uint16[15] cell_vol",
    "LowCmd": "MotorCmd[20] motor_cmd, BmsCmd bms_cmd, uint8[40] wireless_remote, uint8[12] led, "
    "uint8[2] fan, uint8 gpio, uint32 reserve, uint32 crc",
    "MotorCmd": "uint8 mode, float32 q, float32 dq, float32 tau, float32 kp, float32 kd, "
    "uint32[3] reserve",
    "BmsCmd": "uint8 off, uint8[3] reserve",
}


def _defined(name: str, *nested: str) -> str:
    texts = [f"{_FIELDS['Head']}, {_FIELDS[name]}"]
    texts += [f"MSG: unitree_go/{part}, {_FIELDS[part]}" for part in nested]
    return f"{'=' * 80}\n".join(text.replace(", ", "\n") + "\n" for text in texts)


DEFINITIONS: Mapping[str, str] = {
    "unitree_go/msg/LowState": _defined("LowState", "IMUState", "MotorState", "BmsState"),
    "unitree_go/msg/LowCmd": _defined("LowCmd", "MotorCmd", "BmsCmd"),
}
"""Definitions of types in bags that have none: those in SQLite of ROS 2 before Iron."""
