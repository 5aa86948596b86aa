"""rosbag2 recordings of a motion, with the noise of sensors and of clocks."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer

from benchmarks.foreign.recorder.encoders import Encoders, encoder_angles, interpolated
from benchmarks.foreign.recorder.messages import ROS, joint_state, odom, wrench
from benchmarks.foreign.robots import Robot
from benchmarks.foreign.world.motion import Motion

EPOCH = 1_700_000_000 * 10**9
"""Time of the first command, ns."""

HELD = 0.1
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


def recorded_items(
    robot: Robot, motion: Motion, encoders: Encoders, noise: Noise, rng: np.random.Generator
) -> list[Item]:
    """Returns the messages of a motion: /joint_states, /joint_commands, /odom and /foot/NAME."""
    return [
        *_joints(robot, motion, encoders, noise, rng),
        *_odometry(motion, noise, rng),
        *_commands(robot, motion),
    ]


def write_bag(
    folder: Path, items: list[Item], rng: np.random.Generator, *, lost: float, mcap: bool
) -> None:
    """Writes a bag.

    Args:
        folder: The bag.
        items: The messages.
        rng: Draws the latency of the recorder, and the messages that are lost.
        lost: Share of the messages that are lost.
        mcap: Whether the messages are stored as MCAP; otherwise as SQLite.
    """
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


def _joints(
    robot: Robot, motion: Motion, encoders: Encoders, noise: Noise, rng: np.random.Generator
) -> Iterator[Item]:
    angles = encoder_angles(robot, motion, encoders)
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
        position = interpolated(motion.time, angles, true) + np.where(
            quiet, 0, rng.normal(0, noise.angle, len(signs))
        )
        speed = interpolated(motion.time, speeds, true) * (true >= 0) + np.where(
            quiet, 0, rng.normal(0, noise.speed, len(signs))
        )
        dead = unknown & (time >= encoders.onset)
        position[dead] = speed[dead] = np.nan
        yield (
            "/joint_states",
            _stamp(time),
            joint_state(_stamp(time), names, (signs * position)[order], (signs * speed)[order]),
        )


def _odometry(motion: Motion, noise: Noise, rng: np.random.Generator) -> Iterator[Item]:
    for time in np.arange(-HELD, motion.time[-1], ODOMETRY_PERIOD):
        true = _jittered(time, noise, rng)
        pose, twist = (
            interpolated(motion.time, motion.pose, true),
            interpolated(motion.time, motion.twist, true),
        )
        twist = twist * (true >= 0)
        turn = pose[3:] / np.linalg.norm(pose[3:])
        turn = turn + rng.normal(0, noise.orientation / 2, 4)
        turn /= np.linalg.norm(turn)
        position = pose[:3] + rng.normal(0, noise.position, 3)
        linear = _rotation(turn).T @ twist[:3] + rng.normal(0, noise.linear, 3)
        angular = twist[3:] + rng.normal(0, noise.angular, 3)
        yield "/odom", _stamp(time), odom(_stamp(time), position, turn, linear, angular)


def _commands(robot: Robot, motion: Motion) -> Iterator[Item]:
    names = [recorded(motor) for motor in robot.motors]
    none = np.zeros(0)
    for time, command, force in zip(
        motion.command_time, motion.commands, motion.touch, strict=True
    ):
        stamp = _stamp(time)
        yield "/joint_commands", stamp, joint_state(stamp, names, command, none)
        for name, value in zip(robot.touches, force, strict=True):
            yield f"/foot/{name}", stamp, wrench(stamp, float(value))


def recorded(name: str) -> str:
    """Returns the name of a hinge or motor in a recording."""
    return f"{name}_joint"


def _jittered(time: float, noise: Noise, rng: np.random.Generator) -> float:
    return float(time + np.clip(rng.normal(0, noise.clock), -0.002, 0.002))


def _stamp(time: float) -> int:
    return EPOCH + round(time * 1e9)


def _rotation(turn: np.ndarray) -> np.ndarray:
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
