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
    from rosbags.typesys.stores import ros2_humble as ros

    from selfmodel.arrays import FloatArray

JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
ARRAY = "std_msgs/msg/Float64MultiArray"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
IMU = "sensor_msgs/msg/Imu"
WRENCH = "geometry_msgs/msg/WrenchStamped"
NUMBERS = ("std_msgs/msg/Float64", "std_msgs/msg/Float32", "std_msgs/msg/Bool")

Rows = tuple[tuple[str, ...], "FloatArray"]
"""Names in a message, and a row of numbers for each, ``(names, width)``."""

CDR, ROS1 = "cdr", "ros1"
"""Encodings of messages: that of ROS 2 with DDS, and that of ROS 1."""


class RefusedError(ValueError):
    """A message contradicts itself; it is counted and left out."""


ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame. A CDR message begins with 0."""


def decode(data: bytes, kind: str, encoding: str) -> tuple[int, Rows]:
    """Returns the time stamp of a message, ns (0 if it has none), and its rows.

    Raises:
        RefusedError: The message contradicts itself.
    """
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


def _joint_state(message: "ros.sensor_msgs__msg__JointState") -> Rows:
    names = _distinct(message.name)
    rows = np.full((len(names), 3), np.nan)
    for column, values in enumerate((message.position, message.velocity, message.effort)):
        if len(values) == len(names):
            rows[:, column] = values
        elif len(values):
            raise RefusedError("with more or fewer numbers than names")
    return names, rows


def _trajectory(message: "ros.trajectory_msgs__msg__JointTrajectory") -> Rows:
    names = _distinct(message.joint_names)
    if not message.points:
        raise RefusedError("without a point")
    positions = message.points[0].positions
    if len(positions) != len(names):
        raise RefusedError("with more or fewer numbers than names")
    return names, np.array(positions, dtype=np.float64).reshape(-1, 1)


def _distinct(names: list[str]) -> tuple[str, ...]:
    if len(set(names)) != len(names):
        raise RefusedError("with a name twice")
    return tuple(names)


def _array(message: "ros.std_msgs__msg__Float64MultiArray") -> Rows:
    values = np.array(message.data, dtype=np.float64).reshape(-1, 1)
    return tuple(str(column) for column in range(len(values))), values


def _number(message: "ros.std_msgs__msg__Float64") -> Rows:
    return ("",), np.array([[message.data]], dtype=np.float64)


def _wrench(message: "ros.geometry_msgs__msg__WrenchStamped") -> Rows:
    return ("",), np.array([[math.hypot(*_xyz(message.wrench.force))]])


def _odometry(message: "ros.nav_msgs__msg__Odometry") -> Rows:
    twist = message.twist.twist
    row = [*_pose(message.pose.pose), *_xyz(twist.linear), *_xyz(twist.angular)]
    return ("",), np.array([row])


def _pose_stamped(message: "ros.geometry_msgs__msg__PoseStamped") -> Rows:
    return ("",), np.array([[*_pose(message.pose), *[np.nan] * 6]])


def _imu(message: "ros.sensor_msgs__msg__Imu") -> Rows:
    # REP 145: a first covariance of -1 means no measurement.
    known = message.orientation_covariance[0] != -1
    turning = message.angular_velocity_covariance[0] != -1
    row = [
        *(_wxyz(message.orientation) if known else [np.nan] * 4),
        *(_xyz(message.angular_velocity) if turning else [np.nan] * 3),
    ]
    return ("",), np.array([row])


def _pose(pose: "ros.geometry_msgs__msg__Pose") -> list[float]:
    return [*_xyz(pose.position), *_wxyz(pose.orientation)]


def _xyz(vector: "ros.geometry_msgs__msg__Point | ros.geometry_msgs__msg__Vector3") -> list[float]:
    return [vector.x, vector.y, vector.z]


def _wxyz(quaternion: "ros.geometry_msgs__msg__Quaternion") -> list[float]:
    return [quaternion.w, quaternion.x, quaternion.y, quaternion.z]


DECODERS: Mapping[str, Callable[[Any], Rows]] = MappingProxyType(
    {
        JOINT_STATE: _joint_state,
        TRAJECTORY: _trajectory,
        ARRAY: _array,
        ODOMETRY: _odometry,
        POSE: _pose_stamped,
        IMU: _imu,
        WRENCH: _wrench,
        **dict.fromkeys(NUMBERS, _number),
    }
)
"""Decoders of the supported message types into names and rows of numbers.

Widths: JointState 3 (position, velocity, effort), those of commands 1, Odometry and PoseStamped 13
(position, orientation w x y z, linear and angular velocity in the child's frame), Imu 7
(orientation w x y z, angular velocity), touch 1. Missing numbers are NaN. The columns of a
Float64MultiArray are named by their index; of types with one column, it has no name.
"""
