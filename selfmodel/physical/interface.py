"""The interface of a physical robot, and the limits beyond which one is stopped."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample

NORM_TOLERANCE = 0.01
"""Largest deviation of a measured quaternion's norm from 1."""


class PhysicalRobot(Protocol):
    """Physical robot: runs a controller and yields samples.

    Diagnosis and recovery have access to a physical robot through this method only.
    """

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller from the initial pose and yields each sample during its control step.

        The robot stops when the caller stops iterating.

        Yields:
            State, readings and commands of each control step, ``steps`` samples. Sample times are
            nominal, exact multiples of the control time step; the measured time of a step of a
            ``TimedRobot`` is in the sample's ``moment``.
        """
        ...


@runtime_checkable
class TimedRobot(PhysicalRobot, Protocol):
    """Physical robot with a clock of its own: each of its samples has a ``moment``.

    The trials of such a robot are not reproducible, so the log of a trial that was stopped early is
    finished and marked as stopped; the log of a simulated robot remains an unfinished file.
    """

    @property
    def clock(self) -> Callable[[], float]:
        """Monotonic clock: returns the time, s, from any origin."""
        ...


@runtime_checkable
class ObservedRobot(PhysicalRobot, Protocol):
    """Physical robot that declares what it observes; all others are taken to observe everything."""

    @property
    def signals(self) -> Collection[Signal]:
        """Signals that its samples have, commands included; the others are NaN."""
        ...


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
    ranges = [hinge.range if hinge.limited[0] else (-np.inf, np.inf) for hinge in hinges]
    low, high = np.array(ranges).reshape(-1, 2).T

    def reason(observed: Mapping[Signal, FloatArray]) -> str:
        angles = observed["joint_positions"]
        beyond = np.flatnonzero((angles < low - margin) | (angles > high + margin))
        if not len(beyond):
            return ""
        k = int(beyond[0])
        return (
            f"{names[k]} is at {angles[k]:.3f}, beyond its range of {low[k]:.3f} to "
            f"{high[k]:.3f} and the margin of {margin:g}"
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
