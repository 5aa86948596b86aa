"""The score ``upright`` with limits on speeds and torques of the joints and on self-collision."""

import math

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.build import build, detached_bodies
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores.falls import first_lasting, steps_of
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.upright import UPRIGHT, falls_of
from selfmodel.robot.robot import Robot
from selfmodel.robot.self_collision import penetration_depths
from selfmodel.trials.behaviour import Behaviour

COLLISION_TIME = 0.05
"""Time over which a self-collision is judged, s: two bodies are too deep in each other in more than
half of the measurements. Wrong measurements of single steps are shorter; legs that pass through
each other at the pace of a walk are longer."""


def upright_within(
    max_speed: float = math.inf,
    max_torque: float = math.inf,
    max_self_collision: float = math.inf,
) -> Score:
    """Returns the displacement up to the first fall or self-collision, in steps within limits.

    Forward displacement counts in the control steps in which all joints are within the limits,
    backward displacement in all. A gait that needs more than the motors of a robot are to give is
    worth what it walks without. From a self-collision on nothing counts, as from a fall on: a robot
    does not go on with a leg in the place of another.

    Args:
        max_speed: Largest speed of a joint, rad/s; m/s for a slide joint.
        max_torque: Largest torque of a joint, N m; N for a slide joint.
        max_self_collision: Largest depth to which two bodies of the robot penetrate each other, by
            its joint positions, m; see ``penetration_depths`` for the bodies that are compared. A
            self-collision is the first step from which, for most of ``COLLISION_TIME``, two are
            deeper in each other.

    Raises:
        ValueError: The limit of speed or torque is not above 0, or that of the depth is below 0.
    """
    if not (max_speed > 0 and max_torque > 0 and max_self_collision >= 0):
        raise ValueError(
            f"expected limits above 0, and a depth of 0 or above, got {max_speed}, {max_torque} "
            f"and {max_self_collision}"
        )
    compares_bodies = math.isfinite(max_self_collision)

    def of(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
        moved = np.diff(_held(behaviour["base_position"][..., 0]), axis=-1)
        # A joint that has come off lies on the ground, and is not the robot's.
        detached = build(robot, hypothesis).detached
        own = [j for j, name in enumerate(robot.anatomy.hinges) if name not in detached]
        over = _over(behaviour["joint_velocities"][..., own], max_speed)
        over |= _over(behaviour["joint_efforts"][..., own], max_torque)
        counted = np.where(over[..., 1:], np.minimum(moved, 0.0), moved)
        end = falls_of(robot, hypothesis, behaviour)
        if compares_bodies:
            deep = _depths(robot, hypothesis, behaviour) > max_self_collision
            steps = steps_of(COLLISION_TIME, behaviour)
            end = np.minimum(end, first_lasting(deep, ~deep, steps))
        before = np.arange(1, behaviour.steps) < end[..., np.newaxis]
        return np.asarray(np.where(before, counted, 0.0).sum(axis=-1))

    limits = [
        f"{limit:g} {unit}"
        for limit, unit in (
            (max_speed, "rad/s"),
            (max_torque, "N m"),
            (max_self_collision, "m of self-collision"),
        )
        if math.isfinite(limit)
    ]
    name = " ".join([UPRIGHT.name, *(["within", " and ".join(limits)] if limits else [])])
    record = (*UPRIGHT.record, "joint_velocities", "joint_efforts")
    signals = (*record, "joint_positions") if compares_bodies else record
    return Score(name, signals, of, unit="m", grows_with_time=True, needs_free_base=True)


def _depths(robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> FloatArray:
    """Returns the depth of self-collision at each step, m, ``(..., steps)``.

    A joint without a measurement is where it was last measured, or else in the initial pose.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the robot: detached bodies do not count, and encoders have offsets.
        behaviour: Joint positions, ``(..., steps, hinges)``.
    """
    logged = np.moveaxis(_held(np.moveaxis(behaviour["joint_positions"], -1, -2)), -2, -1)
    angles = logged - build(robot, hypothesis).encoder_offset
    initial = [float(robot.model.joint(name).qpos0[0]) for name in robot.anatomy.hinges]
    poses = np.where(np.isfinite(angles), angles, initial)
    lost = detached_bodies(robot.anatomy, robot.model, hypothesis)
    depths = penetration_depths(robot, poses.reshape(-1, len(initial)), lost)
    return depths.reshape(poses.shape[:-1])


def _held(values: FloatArray) -> FloatArray:
    """Returns values with those that are not known replaced by the last known one.

    Args:
        values: ``(..., steps)``; NaN where not known. It remains where none is known before.
    """
    steps = np.where(np.isfinite(values), np.arange(values.shape[-1]), 0)
    return np.take_along_axis(values, np.maximum.accumulate(steps, axis=-1), axis=-1)


def _over(values: FloatArray, limit: float) -> BoolArray:
    """Returns whether the value of a joint is over a limit, ``(..., steps)``; NaN is not."""
    return np.asarray((np.abs(values) > limit).any(axis=-1))
