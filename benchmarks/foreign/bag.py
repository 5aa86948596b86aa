"""rosbag2 recordings of a motion, with the noise of sensors and of clocks."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from benchmarks.foreign.faults import Fault
from benchmarks.foreign.motion import Motion
from benchmarks.foreign.robots import Robot

ROS = get_typestore(Stores.ROS2_HUMBLE)
EPOCH = 1_700_000_000 * 10**9
"""Time of the first command, ns."""

HELD = 0.1
"""Time that is recorded before the first command, s: the robot stands."""

JOINT_PERIOD, ODOMETRY_PERIOD = 0.005, 0.01
"""Periods of the joint states and of the odometry, s."""

Item = tuple[str, int, object]
"""A topic, a stamp in ns, and a message."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the noise, and the share of messages that are lost."""

    angle: float = 0.01
    speed: float = 0.1
    position: float = 0.001
    orientation: float = 0.002
    linear: float = 0.01
    angular: float = 0.02
    clock: float = 0.0003
    lost: float = 0.005

    def scaled(self, size: float) -> "Noise":
        """Returns the noise of a gap of another size."""
        return Noise(*(size * value for value in vars(self).values()))


@dataclass(frozen=True)
class Encoders:
    """How the encoders are recorded.

    Attributes:
        signs: Direction of each hinge's encoder, 1 or -1.
        offsets: Offset of the encoder of each hinge, rad.
        broken: Behaviour of the encoders of hinges that are lost or not recorded; one of
            ``faults.ENCODERS`` by hinge.
        onset: Time from which ``offsets`` and ``broken`` hold, s.
    """

    signs: dict[str, int]
    offsets: dict[str, float]
    broken: dict[str, str]
    onset: float


def encoders_of(
    robot: Robot, faults: tuple[Fault, ...], onset: float, signs: dict[str, int]
) -> Encoders:
    """Returns how the encoders of a robot with faults are recorded."""
    broken: dict[str, str] = {}
    for fault in faults:
        if fault.kind == "lost":
            broken.update(dict.fromkeys(robot.part(fault.part).beyond, fault.encoders))
        if fault.kind == "encoder":
            broken[fault.part] = fault.encoders
    offsets = {fault.part: fault.value for fault in faults if fault.kind == "encoder-offset"}
    return Encoders(signs, offsets, broken, onset)


def write_bag(
    folder: Path,
    robot: Robot,
    motion: Motion,
    encoders: Encoders,
    noise: Noise,
    rng: np.random.Generator,
    *,
    mcap: bool,
) -> None:
    """Writes a recording: /joint_states, /joint_commands, /odom and /foot/NAME."""
    items = [
        *_joints(robot, motion, encoders, noise, rng),
        *_odometry(motion, noise, rng),
        *_commands(robot, motion, noise, rng),
    ]
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        known: dict[str, object] = {}
        for topic, stamp, message in sorted(items, key=lambda item: item[1]):
            if rng.random() < noise.lost and stamp > EPOCH:
                continue
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS)
            late = stamp + round(1e6 + 1e6 * rng.exponential(1.0))
            writer.write(known[topic], late, ROS.serialize_cdr(message, kind))


def _joints(
    robot: Robot, motion: Motion, encoders: Encoders, noise: Noise, rng: np.random.Generator
) -> Iterator[Item]:
    angles = _encoder_angles(robot, motion, encoders)
    speeds = motion.speeds.copy()
    for k, hinge in enumerate(robot.hinges):
        if encoders.broken.get(hinge) == "follows":
            after = motion.time >= encoders.onset
            speeds[after, k] = np.gradient(angles[:, k], motion.time)[after]
    signs = np.array([encoders.signs[hinge] for hinge in robot.hinges])
    left_out = [h for h in robot.hinges if encoders.broken.get(h) == "none"]
    order = [k for k in rng.permutation(len(robot.hinges)) if robot.hinges[k] not in left_out]
    names = [recorded(robot.hinges[k]) for k in order]
    still = np.array([encoders.broken.get(h) in ("freezes", "nan") for h in robot.hinges])
    unknown = np.array([encoders.broken.get(h) == "nan" for h in robot.hinges])
    for time in np.arange(-HELD, motion.time[-1], JOINT_PERIOD):
        true = _jittered(time, noise, rng)
        quiet = still & (time >= encoders.onset)
        position = _at(motion.time, angles, true) + np.where(
            quiet, 0, rng.normal(0, noise.angle, len(signs))
        )
        speed = _at(motion.time, speeds, true) * (true >= 0) + np.where(
            quiet, 0, rng.normal(0, noise.speed, len(signs))
        )
        dead = unknown & (time >= encoders.onset)
        position[dead] = speed[dead] = np.nan
        yield (
            "/joint_states",
            _stamp(time),
            _joint_state(_stamp(time), names, (signs * position)[order], (signs * speed)[order]),
        )


def _encoder_angles(robot: Robot, motion: Motion, encoders: Encoders) -> np.ndarray:
    """Returns the angle of each encoder; that of a lost limb is frozen, or follows its command."""
    angles = motion.angles.copy()
    after = motion.time >= encoders.onset
    commanded = {hinge: k for k, hinge in enumerate(robot.motors.values())}
    for k, hinge in enumerate(robot.hinges):
        angles[after, k] += encoders.offsets.get(hinge, 0.0)
        mode = encoders.broken.get(hinge)
        if mode == "follows":
            targets = _at(motion.command_time, motion.commands[:, [commanded[hinge]]], motion.time)
            angles[after, k] = _lagged(targets[:, 0], motion.time)[after]
        elif np.isnan(angles[:, k]).any():
            known = angles[~np.isnan(angles[:, k]), k]
            angles[np.isnan(angles[:, k]), k] = known[-1] if len(known) else 0.0
    return angles


def _lagged(targets: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Returns the angle of a motor without a load: its command with a lag of 30 ms."""
    found, angle, share = np.empty(len(targets)), 0.0, (time[1] - time[0]) / 0.03
    for k, target in enumerate(targets):
        found[k] = angle
        angle += min(share, 1.0) * (target - angle)
    return found


def _odometry(motion: Motion, noise: Noise, rng: np.random.Generator) -> Iterator[Item]:
    for time in np.arange(-HELD, motion.time[-1], ODOMETRY_PERIOD):
        true = _jittered(time, noise, rng)
        pose, twist = _at(motion.time, motion.pose, true), _at(motion.time, motion.twist, true)
        twist = twist * (true >= 0)
        turn = pose[3:] / np.linalg.norm(pose[3:])
        turn = turn + rng.normal(0, noise.orientation / 2, 4)
        turn /= np.linalg.norm(turn)
        position = pose[:3] + rng.normal(0, noise.position, 3)
        linear = _rotation(turn).T @ twist[:3] + rng.normal(0, noise.linear, 3)
        angular = twist[3:] + rng.normal(0, noise.angular, 3)
        yield "/odom", _stamp(time), _odom(_stamp(time), position, turn, linear, angular)


def _commands(
    robot: Robot, motion: Motion, noise: Noise, rng: np.random.Generator
) -> Iterator[Item]:
    names = [recorded(motor) for motor in robot.motors]
    none = np.zeros(0)
    for time, command, force in zip(
        motion.command_time, motion.commands, motion.touch, strict=True
    ):
        stamp = _stamp(time)
        yield "/joint_commands", stamp, _joint_state(stamp, names, command, none)
        for name, value in zip(robot.touches, force, strict=True):
            yield f"/foot/{name}", stamp, _wrench(stamp, float(value))


def recorded(name: str) -> str:
    """Returns the name of a hinge or motor in a recording."""
    return f"{name}_joint"


def _jittered(time: float, noise: Noise, rng: np.random.Generator) -> float:
    return float(time + np.clip(rng.normal(0, noise.clock), -0.002, 0.002))


def _stamp(time: float) -> int:
    return EPOCH + round(time * 1e9)


def _at(times: np.ndarray, rows: np.ndarray, when: float | np.ndarray) -> np.ndarray:
    """Returns rows of a table, interpolated linearly; the first row before its start."""
    place = np.clip((np.asarray(when) - times[0]) / (times[1] - times[0]), 0, len(times) - 1)
    low = np.minimum(np.floor(place + 1e-9).astype(int), len(times) - 2)
    part = np.clip(place - low, 0, 1)[..., np.newaxis]
    return np.asarray(rows[low] * (1 - part) + rows[low + 1] * part)


def _rotation(turn: np.ndarray) -> np.ndarray:
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _made(kind: str, **fields: object) -> object:
    return ROS.types[kind](**fields)


def _header(stamp: int, frame: str) -> object:
    time = _made("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return _made("std_msgs/msg/Header", stamp=time, frame_id=frame)


def _vector(values: np.ndarray, kind: str = "Vector3") -> object:
    x, y, z = map(float, values)
    return _made(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def _joint_state(stamp: int, names: list[str], position: np.ndarray, speed: np.ndarray) -> object:
    return _made(
        "sensor_msgs/msg/JointState",
        header=_header(stamp, ""),
        name=names,
        position=np.asarray(position, dtype=np.float64),
        velocity=np.asarray(speed, dtype=np.float64),
        effort=np.zeros(0),
    )


def _odom(
    stamp: int, position: np.ndarray, turn: np.ndarray, linear: np.ndarray, angular: np.ndarray
) -> object:
    w, x, y, z = map(float, turn)
    pose = _made(
        "geometry_msgs/msg/Pose",
        position=_vector(position, "Point"),
        orientation=_made("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
    )
    twist = _made("geometry_msgs/msg/Twist", linear=_vector(linear), angular=_vector(angular))
    unknown = np.zeros(36)
    return _made(
        "nav_msgs/msg/Odometry",
        header=_header(stamp, "odom"),
        child_frame_id="base",
        pose=_made("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
        twist=_made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def _wrench(stamp: int, force: float) -> object:
    zero = np.zeros(3)
    wrench = _made(
        "geometry_msgs/msg/Wrench", force=_vector(np.array([0, 0, force])), torque=_vector(zero)
    )
    return _made("geometry_msgs/msg/WrenchStamped", header=_header(stamp, ""), wrench=wrench)
