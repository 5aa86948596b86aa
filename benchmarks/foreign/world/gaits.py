"""Gaits: sinusoids per joint, and small networks on touch and angle sensors."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.foreign.robots import Robot

HIDDEN = 6
"""Hidden neurons of a network."""


class Gait(Protocol):
    """Commands of the motors as a function of time and measurements."""

    def commands(self, time: float, angles: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Returns the commanded angles, ``(motors,)`` rad.

        Args:
            time: Time since the first command, s.
            angles: Measured angle of each hinge, rad.
            touch: 1 for each foot on the ground, else 0.
        """
        ...


@dataclass(frozen=True)
class Ranges:
    """Centre and half width of the commands of each motor, rad."""

    centre: np.ndarray
    half: np.ndarray


def command_ranges(robot: Robot) -> Ranges:
    """Returns the ranges in which gaits command: those of the driven joints."""
    model = robot.spec().compile()
    limits = np.array([model.joint(hinge).range for hinge in robot.motors.values()])
    return Ranges(limits.mean(axis=1), (limits[:, 1] - limits[:, 0]) / 2)


@dataclass(frozen=True)
class Sinusoids:
    """A sinusoid per motor, which grows in the first half second."""

    ranges: Ranges
    frequency: float
    amplitude: np.ndarray
    phase: np.ndarray
    offset: np.ndarray

    def commands(self, time: float, angles: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Returns the sinusoids at a time; see ``Gait``."""
        del angles, touch
        wave = np.sin(2 * np.pi * self.frequency * time + self.phase)
        grown = min(time / 0.5, 1.0)
        return np.asarray(
            self.ranges.centre + grown * self.ranges.half * (self.amplitude * wave + self.offset)
        )


@dataclass(frozen=True)
class Network:
    """A network of one hidden layer of tanh neurons, with a clock of two phases as inputs."""

    ranges: Ranges
    frequency: float
    inward: np.ndarray
    outward: np.ndarray

    def commands(self, time: float, angles: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Returns the outputs of the network; see ``Gait``."""
        clock = 2 * np.pi * self.frequency * time
        inputs = np.concatenate([touch, angles, [2 * np.sin(clock), 2 * np.cos(clock), 1.0]])
        outputs = np.tanh(self.outward @ np.tanh(self.inward @ inputs))
        grown = min(time / 0.5, 1.0)
        return np.asarray(self.ranges.centre + grown * self.ranges.half * outputs)


def draw_gait(robot: Robot, ranges: Ranges, kind: str, rng: np.random.Generator) -> Gait:
    """Returns a random gait, of the kind ``playback`` or ``network``."""
    motors, frequency = len(robot.motors), rng.uniform(*robot.frequencies)
    if kind == "network":
        inputs = len(robot.touches) + len(robot.hinges) + 3
        return Network(
            ranges,
            frequency,
            inward=rng.normal(0, 0.7, (HIDDEN, inputs)),
            outward=rng.normal(0, 0.8, (motors, HIDDEN)),
        )
    return Sinusoids(
        ranges,
        frequency,
        amplitude=rng.uniform(*robot.amplitudes, motors),
        phase=rng.uniform(0, 2 * np.pi, motors),
        offset=rng.uniform(-0.3, 0.3, motors),
    )


def upright(orientation: np.ndarray) -> bool:
    """Returns whether the root's z axis is within 60 degrees of the world's."""
    w, x, y, z = orientation
    return bool(w * w - x * x - y * y + z * z > 0.5)
