"""Messages of ROS 1 and ROS 2, decoded without ROS into names and rows of numbers."""

import math
from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import zstandard
from rosbags.typesys import Stores, get_typestore

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

TYPES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "joints": (JOINT_STATE,),
        "commands": (JOINT_STATE, ARRAY, TRAJECTORY),
        "base": (ODOMETRY, POSE),
        "imu": (IMU,),
        "touch": (WRENCH, *NUMBERS, ARRAY),
    }
)
"""Message types that can play each role."""

Rows = tuple[tuple[str, ...], "FloatArray"]
"""Names in a message, and a row of numbers for each, ``(names, width)``."""

CDR, ROS1 = "cdr", "ros1"
"""Encodings of messages: that of ROS 2 with DDS, and that of ROS 1."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame. A CDR message begins with 0."""


class RefusedError(ValueError):
    """A message contradicts itself; it is counted and left out."""


def decode(data: bytes, kind: str, encoding: str) -> tuple[int, Rows]:
    """Returns the time stamp of a message, ns (0 if it has none), and its rows."""
    if encoding == CDR and data.startswith(ZSTD_MAGIC):
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            data = reader.readall()
    message: Any = (
        _store(Stores.ROS1_NOETIC).deserialize_ros1(data, kind)
        if encoding == ROS1
        else _store(Stores.ROS2_HUMBLE).deserialize_cdr(data, kind)
    )
    stamp = 0
    if hasattr(message, "header"):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    if stamp < 0:
        raise RefusedError("with a stamp before 1970")
    return stamp, DECODERS[kind](message)


@cache
def _store(store: Stores) -> "Typestore":
    """Message types; those in ``DECODERS`` are the same in every distribution of ROS 1 or 2."""
    return get_typestore(store)


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
    """One row, whose column has no name."""
    return ("",), np.array([numbers], dtype=np.float64)


def _imu(message: Any) -> Rows:  # noqa: ANN401
    # REP 145: a first covariance of -1 means no measurement.
    known = message.orientation_covariance[0] != -1
    turning = message.angular_velocity_covariance[0] != -1
    return _one(
        *(_wxyz(message.orientation) if known else [np.nan] * 4),
        *(_xyz(message.angular_velocity) if turning else [np.nan] * 3),
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


DECODERS: Mapping[str, Callable[[Any], Rows]] = MappingProxyType(
    {
        JOINT_STATE: lambda m: _named(m.name, m.position, m.velocity, m.effort),
        TRAJECTORY: _trajectory,
        ARRAY: _array,
        ODOMETRY: _odometry,
        POSE: lambda m: _one(*_pose(m.pose), *[np.nan] * 6),
        IMU: _imu,
        WRENCH: lambda m: _one(math.hypot(*_xyz(m.wrench.force))),
        **dict.fromkeys(NUMBERS, lambda m: _one(m.data)),
    }
)
"""Decoders of the supported message types into names and rows of numbers.

Widths: JointState 3 (position, velocity, effort), those of commands 1, Odometry and PoseStamped 13
(position, orientation w x y z, linear and angular velocity in the child's frame), Imu 7
(orientation w x y z, angular velocity), touch 1. Missing numbers are NaN. The columns of a
Float64MultiArray are named by their index; of types with one column, it has no name.
"""
