"""Messages of ROS 2."""

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

Message = Any
"""A message of any type: rosbags makes the types at run time."""

ROS = get_typestore(Stores.ROS2_HUMBLE)


def made(kind: str, **fields: Message) -> Message:
    """Returns a message of a type, such as ``std_msgs/msg/Bool``."""
    return ROS.types[kind](**fields)


def header(stamp: int, frame: str) -> Message:
    """Returns a header."""
    time = made("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return made("std_msgs/msg/Header", stamp=time, frame_id=frame)


def vector(values: np.ndarray, kind: str = "Vector3") -> Message:
    """Returns a vector, or a point."""
    x, y, z = map(float, values)
    return made(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def joint_state(stamp: int, names: list[str], position: np.ndarray, speed: np.ndarray) -> Message:
    """Returns a JointState without efforts."""
    return made(
        "sensor_msgs/msg/JointState",
        header=header(stamp, ""),
        name=names,
        position=np.asarray(position, dtype=np.float64),
        velocity=np.asarray(speed, dtype=np.float64),
        effort=np.zeros(0),
    )


def odom(
    stamp: int, position: np.ndarray, turn: np.ndarray, linear: np.ndarray, angular: np.ndarray
) -> Message:
    """Returns an Odometry without covariances."""
    w, x, y, z = map(float, turn)
    pose = made(
        "geometry_msgs/msg/Pose",
        position=vector(position, "Point"),
        orientation=made("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
    )
    twist = made("geometry_msgs/msg/Twist", linear=vector(linear), angular=vector(angular))
    unknown = np.zeros(36)
    return made(
        "nav_msgs/msg/Odometry",
        header=header(stamp, "odom"),
        child_frame_id="base",
        pose=made("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
        twist=made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def wrench(stamp: int, force: float) -> Message:
    """Returns a WrenchStamped: a force along z, N."""
    zero = np.zeros(3)
    wrench = made(
        "geometry_msgs/msg/Wrench", force=vector(np.array([0, 0, force])), torque=vector(zero)
    )
    return made("geometry_msgs/msg/WrenchStamped", header=header(stamp, ""), wrench=wrench)
