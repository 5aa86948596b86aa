"""Bags that the tests make: messages, written in every form that rosbag2 has."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
T0 = 1_700_000_000 * 10**9
"""When the made-up bags begin, ns."""

Item = tuple[str, int, object]
"""A topic, a log time in ns, and a message; or the bytes of an event of a service."""

EVENT = "example_interfaces/srv/AddTwoInts_Event"
SERVICE = {"msgdef": "int64 a\nint64 b\n---\nint64 sum\n", "rihs01": "RIHS01_"}
"""What a recorder of ROS 2 writes for the definition of an event: that of its service."""

FORMS = {
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap-file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap-message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "mcap-chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "sqlite": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite-file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite-message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
}


def write_bag(folder: Path, items: Iterable[Item], form: str = "mcap") -> Path:
    """Writes a bag in one of ``FORMS`` and returns its folder."""
    plugin, mode = FORMS[form]
    writer = Writer(folder, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        known = {}
        for topic, time, message in sorted(items, key=lambda item: item[1]):
            kind = getattr(message, "__msgtype__", EVENT)
            defined = SERVICE if kind == EVENT else {"typestore": ROS}
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, **defined)
            data = message if kind == EVENT else ROS.serialize_cdr(message, kind)
            writer.write(known[topic], time, data)
    return folder


def write_mcap(
    path: Path, items: Iterable[Item], *, encoding: str = "cdr", **options: object
) -> int:
    """Writes a file as other writers of MCAP do; returns the place of its end before the summary.

    The names of types lack their middle, as in old recordings.
    """
    rows = []
    for topic, time, message in sorted(items, key=lambda item: item[1]):
        kind = message.__msgtype__
        data = ROS.serialize_cdr(message, kind) if encoding == "cdr" else ros1_payload(message)
        rows.append((Defined(topic, kind.replace("/msg/", "/"), encoding=encoding), time, data))
    return write_defined(path, rows, **options)


class Defined(NamedTuple):
    """A topic of MCAP, with the definition of its type."""

    topic: str
    kind: str
    definition: str = ""
    language: str = "ros2msg"
    encoding: str = "cdr"


def write_defined(
    path: Path, rows: Iterable[tuple[Defined, int, bytes | memoryview]], **options: object
) -> int:
    """Writes messages as bytes with their log times; see ``write_mcap``."""
    with path.open("wb") as file:
        writer, channels = McapWriter(file, **options), {}
        writer.start("ros2")
        for of, time, data in rows:
            if of not in channels:
                schema = writer.register_schema(of.kind, of.language, of.definition.encode())
                channels[of] = writer.register_channel(of.topic, of.encoding, schema)
            writer.add_message(channels[of], time, bytes(data), time)
        end = file.tell()
        writer.finish()
    return end


ROS1_FORMS = {
    "none": None,
    "bz2": Ros1Writer.CompressionFormat.BZ2,
    "lz4": Ros1Writer.CompressionFormat.LZ4,
}


def write_ros1(
    path: Path,
    items: Iterable[Item],
    form: str = "none",
    key: Callable[[Item], int] = lambda item: item[1],
) -> Path:
    """Writes a ROS 1 bag in one of ``ROS1_FORMS``, sorted, in several chunks; returns its path."""
    writer = Ros1Writer(path)
    writer.chunk_threshold = 2**14
    if (compression := ROS1_FORMS[form]) is not None:
        writer.set_compression(compression)
    with writer:
        known = {}
        for topic, time, message in sorted(items, key=key):
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(known[topic], time, ros1_payload(message))
    return path


def ros1_payload(message: object) -> memoryview:
    """A message in the encoding of ROS 1."""
    kind = message.__msgtype__
    return ROS.cdr_to_ros1(ROS.serialize_cdr(message, kind), kind)


def storage(folder: Path) -> Path:
    """The one storage file of a bag."""
    (found,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    return found


def made(kind: str, **values: object) -> object:
    """A message of a type, such as ``std_msgs/msg/Bool``.

    A dict is a message within it; what is not given is zero or empty.
    """
    fields = {}
    for name, (node, about) in ROS.fielddefs[kind][1]:
        value = values.get(name)
        if node == Nodetype.NAME:
            fields[name] = made(about, **(value or {}))
        elif node == Nodetype.BASE:
            fields[name] = value or ("" if about[0] == "string" else 0)
        elif about[0][0] == Nodetype.BASE and about[0][1][0] != "string":
            given = np.zeros(about[1]) if value is None else value
            fields[name] = np.array(given, about[0][1][0].replace("byte", "uint8"))
        elif node == Nodetype.ARRAY:
            fields[name] = [made(about[0][1], **of) for of in value]
        else:
            fields[name] = list(value or [])
    return ROS.types[kind](**fields)


def header(stamp: int, frame: str = "") -> dict[str, object]:
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": frame}


def joint_state(
    stamp: int,
    names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> object:
    numbers = {"position": position, "velocity": velocity, "effort": effort}
    return made("sensor_msgs/msg/JointState", header=header(stamp), name=names, **numbers)


def array(values: Sequence[float]) -> object:
    return made("std_msgs/msg/Float64MultiArray", data=values)


def trajectory(stamp: int, names: Sequence[str], positions: Sequence[float]) -> object:
    point = made("trajectory_msgs/msg/JointTrajectoryPoint", positions=positions)
    return made(
        "trajectory_msgs/msg/JointTrajectory",
        header=header(stamp),
        joint_names=names,
        points=[point],
    )


def vector(values: Sequence[float], names: str = "xyz") -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


def pose(xyz: Sequence[float], wxyz: Sequence[float]) -> dict[str, object]:
    return {"position": vector(xyz), "orientation": vector(wxyz, "wxyz")}


def odometry(
    stamp: int,
    xyz: Sequence[float],
    wxyz: Sequence[float] = (1, 0, 0, 0),
    linear: Sequence[float] = (0, 0, 0),
    angular: Sequence[float] = (0, 0, 0),
) -> object:
    return made(
        "nav_msgs/msg/Odometry",
        header=header(stamp, "odom"),
        child_frame_id="base",
        pose={"pose": pose(xyz, wxyz)},
        twist={"twist": {"linear": vector(linear), "angular": vector(angular)}},
    )


def imu(
    stamp: int,
    wxyz: Sequence[float],
    angular: Sequence[float],
    linear: Sequence[float] | None = None,
    *,
    known: bool = True,
) -> object:
    """An Imu, whose orientation and linear acceleration may be unknown."""
    return made(
        "sensor_msgs/msg/Imu",
        header=header(stamp),
        orientation=vector(wxyz, "wxyz"),
        orientation_covariance=[0.0 if known else -1.0, *[0.0] * 8],
        angular_velocity=vector(angular),
        linear_acceleration=vector(linear or (0, 0, 0)),
        linear_acceleration_covariance=[0.0 if linear else -1.0, *[0.0] * 8],
    )


def wrench(stamp: int, force: Sequence[float]) -> object:
    return made(
        "geometry_msgs/msg/WrenchStamped", header=header(stamp), wrench={"force": vector(force)}
    )


# ---------------------------------------------------------------- Unitree

MOTORS = 20
"""Motors in a message of Unitree's; a quadruped has twelve."""

# unitree_ros2, unitree_go/msg: IMUState, MotorState, BmsState, LowState; MotorCmd, BmsCmd, LowCmd.
_UNITREE = {
    "IMUState": "float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\n"
    "float32[3] rpy\nint8 temperature\n",
    "MotorState": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\n"
    "float32 q_raw\nfloat32 dq_raw\nfloat32 ddq_raw\nint8 temperature\nuint32 lost\n"
    "uint32[2] reserve\n",
    "BmsState": "uint8 version_high\nuint8 version_low\nuint8 status\nuint8 soc\nint32 current\n"
    "uint16 cycle\nint8[2] bq_ntc\nint8[2] mcu_ntc\nuint16[15] cell_vol\n",
    "LowState": "uint8[2] head\nuint8 level_flag\nuint8 frame_reserve\nuint32[2] sn\n"
    "uint32[2] version\nuint16 bandwidth\nIMUState imu_state\nMotorState[20] motor_state\n"
    "BmsState bms_state\nint16[4] foot_force\nint16[4] foot_force_est\nuint32 tick\n"
    "uint8[40] wireless_remote\nuint8 bit_flag\nfloat32 adc_reel\nint8 temperature_ntc1\n"
    "int8 temperature_ntc2\nfloat32 power_v\nfloat32 power_a\nuint16[4] fan_frequency\n"
    "uint32 reserve\nuint32 crc\n",
    "MotorCmd": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\n"
    "uint32[3] reserve\n",
    "BmsCmd": "uint8 off\nuint8[3] reserve\n",
    "LowCmd": "uint8[2] head\nuint8 level_flag\nuint8 frame_reserve\nuint32[2] sn\n"
    "uint32[2] version\nuint16 bandwidth\nMotorCmd[20] motor_cmd\nBmsCmd bms_cmd\n"
    "uint8[40] wireless_remote\nuint8[12] led\nuint8[2] fan\nuint8 gpio\nuint32 reserve\n"
    "uint32 crc\n",
}
for _name, _text in _UNITREE.items():
    ROS.register(get_types_from_msg(_text, f"unitree_go/msg/{_name}"))


def low_state(
    position: Sequence[float],
    velocity: Sequence[float],
    effort: Sequence[float],
    *,
    wxyz: Sequence[float] = (1, 0, 0, 0),
    gyroscope: Sequence[float] = (0, 0, 0),
    feet: Sequence[int] = (0, 0, 0, 0),
) -> object:
    """A LowState, whose motors beyond those given are at 0."""
    motors = [
        {"q": q, "dq": dq, "tau_est": tau}
        for q, dq, tau in zip(position, velocity, effort, strict=True)
    ]
    motors += [{}] * (MOTORS - len(motors))
    imu_state = {"quaternion": wxyz, "gyroscope": gyroscope, "accelerometer": (0, 0, 9.5)}
    return made("unitree_go/msg/LowState", imu_state=imu_state, motor_state=motors, foot_force=feet)


def low_command(position: Sequence[float]) -> object:
    motors = [{"q": q, "kp": 60.0} for q in position]
    return made("unitree_go/msg/LowCmd", motor_cmd=motors + [{}] * (MOTORS - len(motors)))
