"""Safety limits: conditions on an observation under which a robot is stopped."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import Signal

NORM_TOLERANCE = 0.01
"""Largest deviation of a measured quaternion's norm from 1."""


@dataclass(frozen=True)
class Limit:
    """Safety limit: a condition under which a robot is stopped.

    Attributes:
        signals: Required signals; a robot that does not observe them is stopped too.
        reason: Returns the reason to stop the robot, or "" if no limit is exceeded. The argument
            is the row of each signal, ``(width,)``, NaN where not observed.
    """

    signals: tuple[Signal, ...]
    reason: Callable[[Mapping[Signal, FloatArray]], str]


def joint_limits(robot: Robot, margin: float) -> Limit:
    """Returns a limit on the joint positions: the ranges of the robot's model plus a margin.

    Args:
        robot: The robot; a hinge without a range has no limit.
        margin: Allowed distance beyond the range, rad; m for a slide joint.
    """
    names = robot.anatomy.hinges
    hinges = [robot.model.joint(name) for name in names]
    ranges = np.array(
        [hinge.range if hinge.limited[0] else (-np.inf, np.inf) for hinge in hinges]
    ).reshape(-1, 2)
    lowest, highest = ranges[:, 0] - margin, ranges[:, 1] + margin

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        angles = observed["joint_positions"]
        beyond = np.flatnonzero((angles < lowest) | (angles > highest))
        if not len(beyond):
            return ""
        k = int(beyond[0])
        return (
            f"{names[k]} is at {angles[k]:.3f}, beyond its range of {ranges[k, 0]:.3f} to "
            f"{ranges[k, 1]:.3f} and the margin of {margin:g}"
        )

    return Limit(("joint_positions",), reason)


def tilt_limit(max_tilt: float) -> Limit:
    """Returns a limit on the tilt of the base.

    Args:
        max_tilt: Largest angle between the z axes of the base and the world, rad.
    """

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        _, x, y, _ = orientation = observed["base_orientation"]
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1) > NORM_TOLERANCE:
            return f"base_orientation must be a unit quaternion, got the norm {norm:.2f}"
        tilt = float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))
        if tilt > max_tilt:  # False for NaN: the orientation was not observed
            return f"the base is tilted by {tilt:.2f} rad, more than {max_tilt:g} rad"
        return ""

    return Limit(("base_orientation",), reason)
