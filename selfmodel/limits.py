"""What a robot is stopped for: limits that are looked at in every observation."""

from collections.abc import Callable, Mapping

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.behaviour import Signal
from selfmodel.robot import Robot

Limit = Callable[[Mapping[Signal, FloatArray]], str]
"""Looks at what was observed, ``(width,)`` each with NaN for what was not; returns why the robot
must be stopped, or "" if it need not be."""


def joint_limits(robot: Robot, margin: float) -> Limit:
    """Stops a robot whose hinge is beyond the range that its model gives it.

    Args:
        robot: Whose hinges; those without a range have no limit.
        margin: By how much a hinge may be beyond, rad; m where it slides.
    """
    names = robot.anatomy.hinges
    hinges = [robot.model.joint(name) for name in names]
    ranges = np.array(
        [hinge.range if hinge.limited[0] else (-np.inf, np.inf) for hinge in hinges]
    ).reshape(-1, 2)
    lowest, highest = ranges[:, 0] - margin, ranges[:, 1] + margin

    def limit(observed: Mapping[Signal, FloatArray]) -> str:
        angles = observed["joint_positions"]
        beyond = np.flatnonzero((angles < lowest) | (angles > highest))
        if not len(beyond):
            return ""
        k = int(beyond[0])
        return (
            f"{names[k]} is at {angles[k]:.3f}, beyond its range of {ranges[k, 0]:.3f} to "
            f"{ranges[k, 1]:.3f} and the margin of {margin:g}"
        )

    return limit


def tilt_limit(most: float) -> Limit:
    """Stops a robot whose root body leans too far.

    Args:
        most: The angle that its z axis may have with the world's, rad.
    """

    def limit(observed: Mapping[Signal, FloatArray]) -> str:
        _, x, y, _ = observed["base_orientation"]
        tilt = float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))
        return f"it leans by {tilt:.2f} rad, more than {most:g} rad" if tilt > most else ""

    return limit
