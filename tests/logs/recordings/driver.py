"""A robot's driver: records a simulated trial as ROS 2 would record a real one."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from selfmodel.robot.robot import Robot
from selfmodel.rotation import rotated
from selfmodel.trials.trajectory import Trajectory
from tests.logs.recordings.bags import T0, Item, joint_state, odometry, wrench, write_bag

JOINT_PERIOD, JITTER, JOINT_LATENCY = 0.005, 0.0004, 0.002
ODOMETRY_LATENCY = 0.015
COMMAND_LATENCY = 0.0005
BEFORE = 0.1
"""Seconds that are recorded before the first command, while the robot is held in its start pose."""


def record(folder: Path, robot: Robot, trial: Trajectory) -> Path:
    """Writes the bag of a trial: joints at 200 Hz with jitter, the rest at its own rate."""
    return write_bag(folder, [*_commands(robot, trial), *_joints(robot, trial), *_odometry(trial)])


def mapping(robot: Robot, steps: int, controller: str | None) -> str:
    """The mapping of such a bag: its joints are called otherwise, and some turn the other way."""
    duration = steps * robot.control_timestep
    links = "\n".join(
        f'{hinge} = {{ name = "{_told(hinge)}", sign = {_sign(k)}, offset = {_offset(k)} }}'
        for k, hinge in enumerate(robot.anatomy.hinges)
    )
    motors = "\n".join(f'{motor} = "{_told(motor)}"' for motor in robot.anatomy.motors)
    touches = "\n".join(
        f'[touch.{sensor.name}]\ntopic = "/foot/{sensor.name}"'
        for sensor in robot.anatomy.sensors
        if sensor.kind == "touch"
    )
    drives = f'controller = "{controller}"\n' if controller else ""
    return (
        f'robot = "{robot.name}"\n{drives}duration = {duration}\n'
        f'[joints]\ntopic = "/joint_states"\nunit = "rad"\n'
        f'[joints.names]\n{links}\n[commands]\ntopic = "/joint_commands"\nunit = "rad"\n'
        f'[commands.names]\n{motors}\n[base]\ntopic = "/odom"\n{touches}\n'
    )


def _commands(robot: Robot, trial: Trajectory) -> Iterator[Item]:
    motors = [_told(motor) for motor in robot.anatomy.motors]
    touches = [sensor.name for sensor in robot.anatomy.sensors if sensor.kind == "touch"]
    for time, commands, readings in zip(
        trial.time, trial["commands"], trial["sensors"], strict=True
    ):
        stamp = _stamp(time)
        late = stamp + round(COMMAND_LATENCY * 1e9)
        yield "/joint_commands", late, joint_state(stamp, motors, commands)
        for name, touched in zip(touches, readings, strict=False):  # touch comes first
            yield f"/foot/{name}", late, wrench(stamp, (0, 0, 10 * touched))


def _joints(robot: Robot, trial: Trajectory) -> Iterator[Item]:
    rng = np.random.default_rng(0)
    due = np.arange(JITTER - BEFORE, trial.time[-1] - JITTER, JOINT_PERIOD)
    hinges = range(len(robot.anatomy.hinges))
    order = rng.permutation(len(hinges))
    names = [_told(robot.anatomy.hinges[k]) for k in order]
    signs, offsets = (np.array([of(k) for k in hinges]) for of in (_sign, _offset))
    for time in due + rng.uniform(-JITTER, JITTER, len(due)):
        at, speed = (
            np.array([np.interp(time, trial.time, column) for column in trial[signal].T])
            for signal in ("joint_positions", "joint_velocities")
        )
        late = _stamp(time + JOINT_LATENCY + rng.exponential(0.0005))
        position, velocity = signs * (at - offsets), signs * speed
        state = joint_state(_stamp(time), names, position[order], velocity[order])
        yield "/joint_states", late, state


def _odometry(trial: Trajectory) -> Iterator[Item]:
    held = np.arange(-BEFORE, 0, trial.time[1])
    rows = np.concatenate([np.zeros(len(held), dtype=int), np.arange(trial.steps)])
    for time, k in zip([*held, *trial.time], rows, strict=True):
        turned = trial["base_orientation"][k]
        linear = rotated(trial["base_linear_velocity"][k], turned * [1, -1, -1, -1])
        spin, place = trial["base_angular_velocity"][k], trial["base_position"][k]
        message = odometry(_stamp(time), place, turned, linear, spin)
        yield "/odom", _stamp(time + ODOMETRY_LATENCY), message


def _stamp(seconds: float) -> int:
    return T0 + round(seconds * 1e9)


def _told(name: str) -> str:
    """What this driver calls a joint: ``front_left_knee`` is ``FL_knee_joint``."""
    *leg, part = name.split("_")
    return f"{''.join(word[0].upper() for word in leg)}_{part}_joint"


def _sign(k: int) -> int:
    return -1 if k % 3 == 1 else 1


def _offset(k: int) -> float:
    return 0.05 * k
