"""The second kind of controller: a central pattern generator of phase oscillators.

One oscillator drives each motor. All share one frequency, and keep their amplitude, offset and
phase; they start from rest, and what the sensors read makes their common clock run faster or
slower. Source: Ijspeert, Crespi, Ryczko and Cabelguen, *From swimming to walking with a salamander
robot driven by a spinal cord model* (Science 315:1416, 2007), of which these are the oscillators
after their phases have locked. That readings change the speed of the phase is from Righetti and
Ijspeert, *Pattern generators with sensory feedback for the control of quadruped locomotion* (ICRA
2008).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.command_range import Commands, Ranges, checked_ranges

SLOWEST, FASTEST = 0.5, 4.0
"""Strides a second that a genome can ask for. A leg of 0.1 to 1 m swings by itself 0.5 to 1.6 times
a second, as a pendulum; animals and robots of that size run at two to three times that."""

GROWTH = 20.0
"""How fast the amplitudes grow from 0, 1/s: 96 % after half a second. It is the source's."""

FEEDBACK = 0.5
"""By what part of its speed all sensors together can change the clock, each reading 1: they bend
the rhythm, and it never stands still."""


@dataclass(frozen=True)
class Cpg:
    """What oscillators are connected to, and how often they are asked.

    Attributes:
        sensors: Names of what changes their speed, in order.
        motors: Names of what they drive, in order.
        timestep: Seconds between two commands.
        ranges: What each motor is commanded; the paper's where none is given.

    Raises:
        ValueError: The time step is not above 0, or the ranges do not fit the motors.
    """

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    timestep: float
    ranges: Ranges = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.timestep) and self.timestep > 0):
            raise ValueError(f"the time step must be above 0 s, got {self.timestep}")
        object.__setattr__(self, "ranges", checked_ranges(self.motors, self.ranges))

    @property
    def weights(self) -> int:
        """How many values a genome has: 33 for the paper's quadruped, 67 for its hexapod."""
        return 1 + 3 * len(self.motors) + len(self.sensors)

    def controller(self, genome: FloatArray) -> "Oscillators":
        """Returns the oscillators of a genome, ``(weights,)``."""
        return Oscillators(self, genome)


@dataclass(frozen=True, eq=False)
class Oscillators:
    """Oscillators as their genome says; two are equal when all of that is.

    Attributes:
        cpg: What they are connected to.
        genome: ``(weights,)``, each in [-1, 1]: the frequency, then by motor the amplitudes, the
            offsets and the phases, then by sensor the feedback.

    Raises:
        ValueError: The genome does not fit.
    """

    cpg: Cpg
    genome: FloatArray

    def __post_init__(self) -> None:
        if self.genome.shape != (self.cpg.weights,):
            raise ValueError(
                f"oscillators for {len(self.cpg.sensors)} sensors and {len(self.cpg.motors)} "
                f"motors have {self.cpg.weights} values, got a genome of shape {self.genome.shape}"
            )
        if not np.all(np.abs(self.genome) <= 1):
            raise ValueError("every value of a genome must lie in [-1, 1]")
        object.__setattr__(self, "genome", frozen(self.genome))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Oscillators):
            return NotImplemented
        return self.cpg == other.cpg and self.genome.tobytes() == other.genome.tobytes()

    def __hash__(self) -> int:
        return hash((self.cpg, self.genome.tobytes()))

    @property
    def design(self) -> Cpg:
        """What the genome is decoded with."""
        return self.cpg

    @property
    def frequency(self) -> float:
        """Strides a second while all sensors read 0: equal steps of a gene are equal ratios."""
        middle, width = math.sqrt(SLOWEST * FASTEST), FASTEST / SLOWEST
        return float(middle * width ** (float(self.genome[0]) / 2))

    @property
    def amplitudes(self) -> FloatArray:
        """How far each motor swings, 0 to 1 of its half range, ``(motors,)``."""
        return np.asarray((self._by_motor(0) + 1) / 2)

    @property
    def offsets(self) -> FloatArray:
        """What it swings about, as far as its range leaves room, ``(motors,)``."""
        return np.asarray(self._by_motor(1) * (1 - self.amplitudes))

    @property
    def phases(self) -> FloatArray:
        """By what part of a stride each is ahead of the clock, -1/2 to 1/2, ``(motors,)``."""
        return np.asarray(self._by_motor(2) / 2)

    @property
    def feedback(self) -> FloatArray:
        """By what part each sensor changes the clock's speed where it reads 1, ``(sensors,)``."""
        return np.asarray(self.genome[1 + 3 * len(self.cpg.motors) :] * self._share)

    @property
    def _share(self) -> float:
        return FEEDBACK / max(1, len(self.cpg.sensors))

    def _by_motor(self, which: int) -> FloatArray:
        motors = len(self.cpg.motors)
        return self.genome[1 + which * motors : 1 + (which + 1) * motors]


class Rhythms:
    """The oscillators of many robots, stepped together like a ``Population``.

    A robot's arithmetic is the same to the bit whatever the number of rows and its place among
    them. Between two commands a reading stands, so the clock's advance is exact.

    Args:
        oscillators: One a robot, all of the same ``Cpg``.

    Raises:
        ValueError: They are not.
    """

    def __init__(self, oscillators: Sequence[Oscillators]) -> None:
        cpg = oscillators[0].cpg
        if any(one.cpg != cpg for one in oscillators):
            raise ValueError("oscillators that are stepped together must be connected alike")
        self._timestep = cpg.timestep
        self._commands = Commands(cpg.ranges)
        self._stride = np.array([one.frequency * cpg.timestep for one in oscillators])
        self._amplitudes = np.array([one.amplitudes for one in oscillators])
        self._offsets = np.array([one.offsets for one in oscillators])
        self._phases = np.array([one.phases for one in oscillators])
        self._feedback = np.array([one.feedback for one in oscillators])
        self._clock = np.zeros(len(oscillators))
        self._step = 0
        self.readings = np.zeros((len(oscillators), len(cpg.sensors)))

    def step(self, targets: FloatArray) -> None:
        """Computes the commands of the next step, from what stands in ``readings``.

        Args:
            targets: ``(n, motors)``, written: within the ranges, in each motor's unit.
        """
        turned = self._clock[:, np.newaxis] + self._phases
        turned -= np.floor(turned)
        outputs = np.cos(2 * np.pi * turned)
        outputs *= self._amplitudes
        outputs += self._offsets
        outputs *= amplitude_rise(self._step * self._timestep)
        self._commands.write(outputs, targets)
        # einsum sums each row by itself, in an order that the number of rows does not change.
        speed = 1 + np.einsum("ns,ns->n", self._feedback, self.readings)
        self._clock += self._stride * speed
        self._clock -= np.floor(self._clock)
        self._step += 1


def amplitude_rise(time: float) -> float:
    """Returns what part of their amplitude oscillators have after some time, s.

    It is the solution of r'' = a (a (1 - r) / 4 - r') from rest, where a is ``GROWTH``: critically
    damped, so that the first commands are no jolt.
    """
    turned = GROWTH * time / 2
    return 1 - (1 + turned) * math.exp(-turned)
