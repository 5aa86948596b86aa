"""Poses of a robot's model from the observations of a behaviour."""

from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.robot.state.access import state_writer
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal

POSE: tuple[Signal, ...] = ("joint_positions", "base_position", "base_orientation")
"""Signals that determine a pose."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Pose of a robot at each step.

    Attributes:
        qpos: Positions of the model, ``(steps, nq)``; the last observation where one is missing.
        held: Steps at which an observation is missing, ``(steps,)``.
        missing: Hinges, ``base_position`` and ``base_orientation`` without any observation; they
            are as in the reference pose.
    """

    qpos: FloatArray
    held: BoolArray
    missing: tuple[str, ...]


def poses_of(robot: Robot, model: mujoco.MjModel, behaviour: Behaviour) -> Poses:
    """Returns the poses of a behaviour.

    A missing value is the last observation before it, or the first one.

    Args:
        robot: Robot of the behaviour.
        model: Model with the robot's layout; positions in no signal are as in its reference pose.
        behaviour: One run with the signals of ``POSE``.
    """
    qpos = np.tile(model.qpos0, (behaviour.steps, 1))
    unmoved = np.zeros((behaviour.steps, model.nv))
    held = np.zeros(behaviour.steps, dtype=bool)
    missing: list[str] = []
    state: dict[Signal, FloatArray] = {}
    for signal in POSE:
        values = behaviour[signal]
        seen = np.isfinite(values)
        if signal != "joint_positions":
            # A position or a quaternion with a missing component is missing.
            seen[:] = seen.all(axis=1, keepdims=True)
        known: BoolArray = np.any(seen, axis=0)
        held |= (~seen & known).any(axis=1)
        if signal == "joint_positions":
            names = behaviour.names.columns(signal)
            missing += [name for column, name in enumerate(names) if not known[column]]
            reference = [float(model.joint(name).qpos0[0]) for name in names]
            state[signal] = np.where(known, _filled(values, seen), reference)
        elif known.all():
            state[signal] = _filled(values, seen)
        else:
            missing.append(signal)
    state_writer(robot, {"qpos": qpos, "qvel": unmoved}.__getitem__, model)(state)
    return Poses(qpos, held, tuple(missing))


def _filled(values: FloatArray, seen: BoolArray) -> FloatArray:
    """Returns each value, or else the last observation before it, or else the first one."""
    rows = np.arange(len(values))[:, np.newaxis]
    last = np.maximum.accumulate(np.where(seen, rows, -1), axis=0)
    chosen = np.where(last < 0, seen.argmax(axis=0), last)
    return np.asarray(np.take_along_axis(values, chosen, axis=0))
