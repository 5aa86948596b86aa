"""Names of the supported message types, and of the encodings of messages."""

JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
ARRAY = "std_msgs/msg/Float64MultiArray"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
IMU = "sensor_msgs/msg/Imu"
WRENCH = "geometry_msgs/msg/WrenchStamped"
NUMBERS = ("std_msgs/msg/Float64", "std_msgs/msg/Float32", "std_msgs/msg/Bool")

CDR, ROS1 = "cdr", "ros1"
ENCODINGS = (CDR, ROS1)
"""Encodings of messages: that of ROS 2 with DDS, and that of ROS 1."""


def full_type(kind: str) -> str:
    """Returns the full name of a message type; old recordings omit its ``msg``."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else kind
