"""What a robot is stopped for: limits that are looked at in every observation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Signal

NORM_TOLERANCE = 0.01
"""By how much the length of a measured quaternion may differ from 1."""


@dataclass(frozen=True)
class Limit:
    """What a robot is stopped for.

    Attributes:
        signals: Those without which it says nothing; a robot that does not observe them is stopped
            too.
        reason: Looks at what was observed, ``(width,)`` each with NaN for what was not; returns why
            the robot must be stopped, or "" if it need not be.
    """

    signals: tuple[Signal, ...]
    reason: Callable[[Mapping[Signal, FloatArray]], str]


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


def tilt_limit(most: float) -> Limit:
    """Stops a robot whose root body leans too far.

    Args:
        most: The angle that its z axis may have with the world's, rad.
    """

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        _, x, y, _ = orientation = observed["base_orientation"]
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1) > NORM_TOLERANCE:
            return f"base_orientation is no rotation: a quaternion of length {norm:.2f}, not 1"
        tilt = float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))
        return f"it leans by {tilt:.2f} rad, more than {most:g} rad" if tilt > most else ""

    return Limit(("base_orientation",), reason)
