"""Decoders of the supported message types, into names and rows of numbers."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from selfmodel.logs.recordings.rosbag.answer import Rows
from selfmodel.logs.recordings.rosbag.message_types import (
    ARRAY,
    IMU,
    JOINT_STATE,
    NUMBERS,
    ODOMETRY,
    POSE,
    ROS1,
    TRAJECTORY,
    WRENCH,
)

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore
    from rosbags.typesys.stores import ros2_humble as ros


@dataclass(frozen=True)
class MessageType:
    """Supported message type.

    Attributes:
        stamped: Whether the message has a header with a time stamp.
        rows: Returns the rows of a decoded message.
    """

    stamped: bool
    rows: Callable[[Any], Rows]


class RefusedError(ValueError):
    """A message contradicts itself; it is counted and left out."""


class UndecodableError(ValueError):
    """The bytes of a message do not fit its type."""


def read_message(payload: bytes, kind: str, encoding: str) -> tuple[int, Rows]:
    """Returns the time stamp of a message, ns (0 if it has none), and its rows.

    Args:
        payload: Message.
        kind: Message type, one of ``KINDS``.
        encoding: Encoding, one of ``ENCODINGS``.

    Raises:
        RefusedError: The message contradicts itself.
        UndecodableError: The message is damaged.
    """
    try:
        message: Any = (
            _ros1().deserialize_ros1(payload, kind)
            if encoding == ROS1
            else _ROS2.deserialize_cdr(payload, kind)
        )
    except (SerdeError, IndexError, OverflowError) as failure:
        raise UndecodableError(str(failure)) from failure
    stamp = 0
    if KINDS[kind].stamped:
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    if stamp < 0:
        raise RefusedError("with a stamp before 1970")
    return stamp, KINDS[kind].rows(message)


_ROS2 = get_typestore(Stores.ROS2_HUMBLE)
"""Standard message types. Those in ``KINDS`` are the same in every distribution of ROS 1 or 2."""


@cache
def _ros1() -> "Typestore":
    return get_typestore(Stores.ROS1_NOETIC)


def _joint_state(message: "ros.sensor_msgs__msg__JointState") -> Rows:
    names = tuple(message.name)
    if len(set(names)) != len(names):
        raise RefusedError("with a name twice")
    rows = np.full((len(names), 3), np.nan)
    for column, values in enumerate((message.position, message.velocity, message.effort)):
        if len(values) == len(names):
            rows[:, column] = values
        elif len(values):
            raise RefusedError("with more or fewer numbers than names")
    return names, rows


def _trajectory(message: "ros.trajectory_msgs__msg__JointTrajectory") -> Rows:
    names = tuple(message.joint_names)
    if len(set(names)) != len(names):
        raise RefusedError("with a name twice")
    if not message.points:
        raise RefusedError("without a point")
    positions = message.points[0].positions
    if len(positions) != len(names):
        raise RefusedError("with more or fewer numbers than names")
    return names, np.array(positions, dtype=np.float64).reshape(-1, 1)


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


KINDS: Mapping[str, MessageType] = MappingProxyType(
    {
        JOINT_STATE: MessageType(stamped=True, rows=_joint_state),
        TRAJECTORY: MessageType(stamped=True, rows=_trajectory),
        ARRAY: MessageType(stamped=False, rows=_array),
        ODOMETRY: MessageType(stamped=True, rows=_odometry),
        POSE: MessageType(stamped=True, rows=_pose_stamped),
        IMU: MessageType(stamped=True, rows=_imu),
        WRENCH: MessageType(stamped=True, rows=_wrench),
        **dict.fromkeys(NUMBERS, MessageType(stamped=False, rows=_number)),
    }
)
"""Supported message types by name.

Widths: JointState 3 (position, velocity, effort), those of commands 1, Odometry and PoseStamped 13
(position, orientation w x y z, linear and angular velocity in the child's frame), Imu 7
(orientation w x y z, angular velocity), touch 1. Missing numbers are NaN. The columns of a
Float64MultiArray are named by their index.
"""

# The library generates code per type on first use: once here, not in each child process.
for _kind in KINDS:
    _ROS2.get_msgdef(_kind)
