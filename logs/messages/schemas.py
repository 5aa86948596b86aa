"""Definitions of the ROS 2 messages in a trial log, as embedded text (``ros2msg``).

The definitions are those of ROS 2's common interfaces, as rosbags prints them; a test compares
both. Only those of ``selfmodel_msgs`` are definitions of selfmodel.
"""

from collections.abc import Mapping
from types import MappingProxyType

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
        "selfmodel_msgs/Seal": (
            "std_msgs/Header header\nstring trial\nuint32 index\nuint32 messages\n"
            "uint8[32] identity\nuint8[32] previous\nuint8[32] digest\n"
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
