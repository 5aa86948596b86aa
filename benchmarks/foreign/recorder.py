"""The recorder: encoders, rosbag2 recordings with noise of sensors and clocks, and mappings."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores.ros2_humble import (
    builtin_interfaces__msg__Time as Time,
    geometry_msgs__msg__Point as Point,
    geometry_msgs__msg__Pose as Pose,
    geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance,
    geometry_msgs__msg__Quaternion as Quaternion,
    geometry_msgs__msg__Twist as Twist,
    geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance,
    geometry_msgs__msg__Vector3 as Vector3,
    geometry_msgs__msg__Wrench as Wrench,
    geometry_msgs__msg__WrenchStamped as WrenchStamped,
    nav_msgs__msg__Odometry as Odometry,
    sensor_msgs__msg__Imu as Imu,
    sensor_msgs__msg__JointState as JointState,
    std_msgs__msg__Header as Header,
)

from benchmarks.foreign.cases import Faults
from benchmarks.foreign.motion import Motion
from benchmarks.foreign.robots import Robot

ROS = get_typestore(Stores.ROS2_HUMBLE)

EPOCH = 1_700_000_000 * 10**9
"""Time of the first command, ns."""

STANDING = 0.1
"""Time that is recorded before the first command, s: the robot stands."""

JOINT_PERIOD, ODOMETRY_PERIOD = 0.005, 0.01
"""Periods of the joint states and of the odometry, s."""

Item = tuple[str, int, Any]
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
    """How the encoders are recorded, by hinge."""

    signs: dict[str, int]
    offsets: dict[str, float]
    broken: dict[str, str]
    """``Fault.encoders`` of hinges that are lost or not recorded."""
    onset: float
    """Time from which ``offsets`` and ``broken`` hold, s."""


def encoders_of(robot: Robot, faults: Faults, onset: float, signs: dict[str, int]) -> Encoders:
    """Returns how the encoders of a robot with faults are recorded."""
    broken: dict[str, str] = {}
    offsets: dict[str, float] = {}
    for fault in faults:
        match fault.kind:
            case "lost":
                broken |= dict.fromkeys(robot.part(fault.part).beyond, fault.encoders)
            case "encoder":
                broken[fault.part] = fault.encoders
            case "encoder-offset" | "encoder-slip":
                offsets[robot.part(fault.part).hinges[0]] = fault.value
    return Encoders(signs, offsets, broken, onset)


def recorded(
    robot: Robot, motion: Motion, encoders: Encoders, noise: Noise, rng: np.random.Generator
) -> list[Item]:
    """Returns the messages of a motion: joint states and commands, odometry or IMU, and feet."""
    return [
        *_joints(robot, motion, encoders, noise, rng),
        *_base(motion, noise, rng, odometry=robot.has_odometry),
        *_commands(robot, motion),
    ]


def write_bag(
    folder: Path, items: list[Item], lost: float, rng: np.random.Generator, *, mcap: bool
) -> None:
    """Writes messages as MCAP or SQLite, less a share of them, with a latency of the recorder."""
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        known: dict[str, Any] = {}
        for topic, stamp, message in sorted(items, key=lambda item: item[1]):
            if rng.random() < lost and stamp > EPOCH:
                continue
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS)
            late = stamp + round(1e6 + 1e6 * rng.exponential(1.0))
            writer.write(known[topic], late, ROS.serialize_cdr(message, kind))


def mapping(robot: Robot, encoders: Encoders, duration: float, *, healthy: bool) -> str:
    """Returns the mapping of a recording, as ``selfmodel logs import`` reads it."""
    stage = 'stage = "before"\n' if healthy else ""
    file = f"control_timestep = {robot.control_timestep}\n" if robot.mapped_as != robot.name else ""
    touches = "".join(
        f'\n[touch.{name}]\ntopic = "/foot/{name}"\nunit = "N"\n' for name in robot.touches
    )
    base = (
        f'[base]\ntopic = "/odom"\nframe = "start"\nunit = "m"\n{touches}'
        if robot.has_odometry
        else '[imu]\ntopic = "/imu"\n'
    )
    hinges = "\n".join(
        f"{hinge} = "
        + (
            '"none"'
            if encoders.broken.get(hinge) == "none"
            else f'{{ name = "{hinge}_joint", sign = {encoders.signs[hinge]} }}'
        )
        for hinge in robot.hinges
    )
    motors = "\n".join(f'{motor} = "{motor}_joint"' for motor in robot.motors)
    return (
        f'robot = "{robot.mapped_as}"\n{file}{stage}duration = {duration}\n\n'
        f'[joints]\ntopic = "/joint_states"\nunit = "rad"\n[joints.names]\n{hinges}\n\n'
        f'[commands]\ntopic = "/joint_commands"\nunit = "rad"\n[commands.names]\n{motors}\n\n'
        f"{base}"
    )


def _joints(
    robot: Robot, motion: Motion, encoders: Encoders, noise: Noise, rng: np.random.Generator
) -> Iterator[Item]:
    angles, speeds = _encoded(robot, motion, encoders), motion.speeds.copy()
    modes = np.array([encoders.broken.get(hinge, "") for hinge in robot.hinges])
    after = motion.time >= encoders.onset
    for k in np.flatnonzero(modes == "follows"):
        speeds[after, k] = np.gradient(angles[:, k], motion.time)[after]
    signs = np.array([encoders.signs[hinge] for hinge in robot.hinges])
    order = [k for k in rng.permutation(len(robot.hinges)) if modes[k] != "none"]
    names = [f"{robot.hinges[k]}_joint" for k in order]
    still, unknown = np.isin(modes, ("freezes", "nan")), modes == "nan"
    for time in np.arange(-STANDING, motion.time[-1], JOINT_PERIOD):
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
        message = _joint_state(time, names, (signs * position)[order], (signs * speed)[order])
        yield "/joint_states", _stamp(time), message


def _encoded(robot: Robot, motion: Motion, encoders: Encoders) -> np.ndarray:
    """Returns the angle of each encoder; those of detached limbs are frozen, or follow commands."""
    angles = motion.angles.copy()
    after = motion.time >= encoders.onset
    commanded = {hinge: k for k, hinge in enumerate(robot.motors.values())}
    for k, hinge in enumerate(robot.hinges):
        angles[after, k] += encoders.offsets.get(hinge, 0.0)
        if encoders.broken.get(hinge) == "follows":
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


def _at(times: np.ndarray, rows: np.ndarray, when: float | np.ndarray) -> np.ndarray:
    """Returns rows of a table, interpolated linearly; the first row before its start."""
    place = np.clip((np.asarray(when) - times[0]) / (times[1] - times[0]), 0, len(times) - 1)
    low = np.minimum(np.floor(place + 1e-9).astype(int), len(times) - 2)
    part = np.clip(place - low, 0, 1)[..., np.newaxis]
    return np.asarray(rows[low] + part * (rows[low + 1] - rows[low]))


def _base(
    motion: Motion, noise: Noise, rng: np.random.Generator, *, odometry: bool
) -> Iterator[Item]:
    """Yields the odometry of the root body, or its IMU, whose accelerations are 0."""
    unknown, wide = np.zeros(9), np.zeros(36)
    for time in np.arange(-STANDING, motion.time[-1], ODOMETRY_PERIOD):
        true = _jittered(time, noise, rng)
        pose, twist = _at(motion.time, motion.pose, true), _at(motion.time, motion.twist, true)
        twist = twist * (true >= 0)
        turn = pose[3:] / np.linalg.norm(pose[3:]) + rng.normal(0, noise.orientation / 2, 4)
        turn /= np.linalg.norm(turn)
        w, x, y, z = map(float, turn)
        orientation = Quaternion(x, y, z, w)
        if odometry:
            position = Point(*map(float, pose[:3] + rng.normal(0, noise.position, 3)))
            linear = _vector(_rotation(turn).T @ twist[:3] + rng.normal(0, noise.linear, 3))
        angular = _vector(twist[3:] + rng.normal(0, noise.angular, 3))
        if odometry:
            place = PoseWithCovariance(Pose(position, orientation), wide)
            moved = TwistWithCovariance(Twist(linear, angular), wide)
            yield "/odom", _stamp(time), Odometry(_header(time, "odom"), "base", place, moved)
        else:
            header, still = _header(time, "base"), _vector(np.zeros(3))
            message = Imu(header, orientation, unknown, angular, unknown, still, unknown)
            yield "/imu", _stamp(time), message


def _rotation(turn: np.ndarray) -> np.ndarray:
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _commands(robot: Robot, motion: Motion) -> Iterator[Item]:
    names = [f"{motor}_joint" for motor in robot.motors]
    for time, command, forces in zip(
        motion.command_time, motion.commands, motion.touch, strict=True
    ):
        stamp = _stamp(time)
        yield "/joint_commands", stamp, _joint_state(time, names, command, np.zeros(0))
        for name, force in zip(robot.touches, forces, strict=True):
            wrench = Wrench(_vector(np.array([0, 0, float(force)])), _vector(np.zeros(3)))
            message = WrenchStamped(_header(time, ""), wrench)
            yield f"/foot/{name}", stamp, message


def _jittered(time: float, noise: Noise, rng: np.random.Generator) -> float:
    return float(time + np.clip(rng.normal(0, noise.clock), -0.002, 0.002))


def _stamp(time: float) -> int:
    return EPOCH + round(time * 1e9)


def _header(time: float, frame: str) -> Header:
    return Header(Time(*divmod(_stamp(time), 10**9)), frame)


def _vector(values: np.ndarray) -> Vector3:
    return Vector3(*map(float, values))


def _joint_state(
    time: float, names: list[str], position: np.ndarray, speed: np.ndarray
) -> JointState:
    return JointState(_header(time, ""), names, position, speed, np.zeros(0))
