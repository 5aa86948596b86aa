"""A robot's driver: records a simulated trial as ROS 2 would record a real one.

The physics is stepped here, so that the joints can be sampled at a rate that the control loop does
not have; between two physics steps MuJoCo's integrator moves them along a line, so sampling that
line at a jittered time invents nothing.
"""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, make_batch
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorReader, signal_fields
from tests.logs.recordings.bags import T0, Item, joint_state, odometry, wrench, write_bag

JOINT_PERIOD, JITTER, JOINT_LATENCY = 0.005, 0.0004, 0.002
ODOMETRY_PERIOD, ODOMETRY_LATENCY = 0.02, 0.015
COMMAND_LATENCY = 0.0005
BEFORE, AFTER = 0.1, 0.05
"""Seconds that are recorded before the first command, while the robot is held in its start pose,
and after the trial, while the controller goes on."""


def record(
    folder: Path, robot: Robot, hidden: Hypothesis, controller: Controller, steps: int
) -> Path:
    """Drives a robot and writes the bag: joints at 200 Hz, odometry at 50, the rest at its own.

    Args:
        folder: The bag.
        robot: The robot as its model describes it.
        hidden: What is wrong with it.
        controller: What drives it.
        steps: Control steps.
    """
    more = round(AFTER / robot.control_timestep)
    return write_bag(folder, _driven(robot, hidden, controller, steps + more))


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


def _driven(robot: Robot, hidden: Hypothesis, controller: Controller, steps: int) -> Iterator[Item]:
    variant = build(robot, hidden)
    model, data = variant.model, mujoco.MjData(variant.model)
    mujoco.mj_forward(model, data)
    senses = SensorReader(model, robot.anatomy, [variant])
    brain = make_batch([controller], [variant.silent_neurons], len(robot.anatomy.sensors))
    where = signal_fields(robot)
    states: list[dict[str, FloatArray]] = []

    def look() -> None:
        states.append(
            {
                signal: getattr(data, place.field)[place.columns].copy()
                for signal, place in where.items()
            }
        )

    look()
    motors = [_told(motor) for motor in robot.anatomy.motors]
    touches = [sensor.name for sensor in robot.anatomy.sensors if sensor.kind == "touch"]
    for k in range(steps):
        senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], brain.readings)
        brain.step(data.ctrl[np.newaxis])
        stamp = T0 + round(k * robot.control_timestep * 1e9)
        late = stamp + round(COMMAND_LATENCY * 1e9)
        yield "/joint_commands", late, joint_state(stamp, motors, data.ctrl)
        for name, touched in zip(touches, brain.readings[0], strict=False):  # touch comes first
            yield f"/foot/{name}", late, wrench(stamp, (0, 0, 10 * touched))
        for _ in range(robot.substeps if k + 1 < steps else 0):
            mujoco.mj_step(model, data)
            look()
    rows = {signal: np.array([state[signal] for state in states]) for signal in where}
    held = round(BEFORE / float(model.opt.timestep))
    rows = {
        signal: np.concatenate([values[:1]] * held + [values]) for signal, values in rows.items()
    }
    time = (np.arange(len(states) + held) - held) * float(model.opt.timestep)
    yield from _joints(robot, time, rows)
    yield from _odometry(time, rows)


def _joints(robot: Robot, time: FloatArray, rows: dict[str, FloatArray]) -> Iterator[Item]:
    rng = np.random.default_rng(0)
    due = np.arange(time[0] + JITTER, time[-1] - JITTER, JOINT_PERIOD)
    taken = due + rng.uniform(-JITTER, JITTER, len(due))
    hinges = range(len(robot.anatomy.hinges))
    order = rng.permutation(len(hinges))
    names = [_told(robot.anatomy.hinges[k]) for k in order]
    signs = np.array([_sign(k) for k in hinges])
    offsets = np.array([_offset(k) for k in hinges])
    for t in taken:
        stamp = T0 + round(t * 1e9)
        at, speed = (
            np.array([np.interp(t, time, rows[signal][:, k]) for k in hinges])
            for signal in ("joint_positions", "joint_velocities")
        )
        late = stamp + round((JOINT_LATENCY + rng.exponential(0.0005)) * 1e9)
        position, velocity = signs * (at - offsets), signs * speed
        yield "/joint_states", late, joint_state(stamp, names, position[order], velocity[order])


def _odometry(time: FloatArray, rows: dict[str, FloatArray]) -> Iterator[Item]:
    for k in range(0, len(time), round(ODOMETRY_PERIOD / (time[1] - time[0]))):
        stamp = T0 + round(time[k] * 1e9)
        turned, child = rows["base_orientation"][k], np.zeros(3)
        backward = turned * [1, -1, -1, -1]
        mujoco.mju_rotVecQuat(child, rows["base_linear_velocity"][k], backward)
        yield (
            "/odom",
            stamp + round(ODOMETRY_LATENCY * 1e9),
            odometry(
                stamp,
                rows["base_position"][k],
                turned,
                child,
                rows["base_angular_velocity"][k],
            ),
        )


def _told(name: str) -> str:
    """What this driver calls a joint: ``front_left_knee`` is ``FL_knee_joint``."""
    *leg, part = name.split("_")
    return f"{''.join(word[0].upper() for word in leg)}_{part}_joint"


def _sign(k: int) -> int:
    return -1 if k % 3 == 1 else 1


def _offset(k: int) -> float:
    return 0.05 * k
