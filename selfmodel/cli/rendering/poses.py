"""From what was observed of a robot to how its model stands, for whoever draws it."""

from dataclasses import dataclass

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.robot.state_access import state_writer
from selfmodel.trials.behaviour import Behaviour, Signal

POSE: tuple[Signal, ...] = ("joint_positions", "base_position", "base_orientation")
"""The signals that say how a robot stands."""


@dataclass(frozen=True, eq=False)
class Poses:
    """How a robot stood at each step.

    Attributes:
        qpos: ``(steps, nq)`` positions of the model; of what was not observed, the last that was.
        held: ``(steps,)`` where something was not observed that was at other steps.
        missing: What was observed at no step, and stands as it does at the start: hinges by name,
            ``base_position`` and ``base_orientation``.
    """

    qpos: FloatArray
    held: BoolArray
    missing: tuple[str, ...]


def poses_of(robot: Robot, model: mujoco.MjModel, behaviour: Behaviour) -> Poses:
    """Returns how a robot stood, as far as a behaviour tells.

    Before the first observation of something stands the first one.

    Args:
        robot: Whose behaviour it is.
        model: Of the robot's layout; what stands in no signal is as in its reference pose.
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
            # A part of a position or of a quaternion is none.
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
    """Each value, or the last one seen before it, or the first."""
    rows = np.arange(len(values))[:, np.newaxis]
    last = np.maximum.accumulate(np.where(seen, rows, -1), axis=0)
    chosen = np.where(last < 0, seen.argmax(axis=0), last)
    return np.asarray(np.take_along_axis(values, chosen, axis=0))
