"""Central pattern generator (CPG): a controller design of coupled phase oscillators.

The CPG has one oscillator per motor. All oscillators share one frequency; each has an amplitude, an
offset and a phase. The amplitudes grow from 0 at the start, and sensor readings speed up or slow
down the shared phase. Source: Ijspeert, Crespi, Ryczko and Cabelguen, *From swimming to walking
with a salamander robot driven by a spinal cord model* (Science 315:1416, 2007); the equations
here are those of its oscillators after phase locking. The feedback of readings on the speed of the
phase is from Righetti and Ijspeert, *Pattern generators with sensory feedback for the control of
quadruped locomotion* (ICRA 2008).
"""

import math
from collections.abc import Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import (
    HOLDS,
    CommandScaler,
    Design,
    HeadingHold,
)

MIN_FREQUENCY, MAX_FREQUENCY = 0.5, 4.0
"""Bounds of the stride frequency, Hz. A leg of 0.1 to 1 m has a natural pendulum frequency of 0.5
to 1.6 Hz; animals and robots of that size run at two to three times that frequency."""

AMPLITUDE_RATE = 20.0
"""Rate at which the amplitudes grow from 0, 1/s: 96 % after half a second. Source: Ijspeert et
al."""

MAX_FEEDBACK = 0.5
"""Largest relative change of the phase speed by all sensors together, each reading 1. The value
is below 1, so the phase always advances."""

MAX_TIMESTEP = 3600.0
"""Upper bound of the control time step, s, that of a log: the phase stays finite."""


@dataclass(frozen=True)
class Cpg(Design):
    """Design of a CPG for a control time step, s.

    Attributes:
        timestep: Control time step, s.

    Raises:
        ValueError: The time step is out of range, or the ranges do not fit the motors.
    """

    name: ClassVar[str] = "cpg"

    timestep: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.timestep <= MAX_TIMESTEP:
            raise ValueError(
                f"the time step must be above 0 s and at most {MAX_TIMESTEP:g} s, "
                f"got {self.timestep}"
            )

    @property
    def weights(self) -> int:
        """Length of a genome: 33 for the paper's quadruped, 67 for its hexapod."""
        return 1 + (3 + self.heading) * len(self.motors) + len(self.sensors)

    @property
    def description(self) -> str:
        """Numbers of sensors and motors and the time step as text."""
        return (
            f"a CPG of {len(self.sensors)} sensors and {len(self.motors)} motors with steps of "
            f"{self.timestep:g} s{HOLDS * self.heading}"
        )

    def summary(self, genome: FloatArray) -> str:
        """Returns the stride frequency as text."""
        return f"a CPG of {self.decode(genome).frequency:.2f} Hz"

    def decode(self, genome: FloatArray) -> "CpgParameters":
        """Returns the parameters of a genome, ``(weights,)``, each value in [-1, 1].

        It has the frequency, then per motor the amplitudes, the offsets and the phases, then per
        sensor the feedback, then per motor the heading hold.
        """
        motors = len(self.motors)
        ends = np.cumsum([1, 3 * motors, len(self.sensors)])
        _, own, feedback, heading = np.split(genome, ends)
        amplitude, offset, phase = own.reshape(3, motors)
        middle = math.sqrt(MIN_FREQUENCY * MAX_FREQUENCY)
        width = MAX_FREQUENCY / MIN_FREQUENCY
        amplitudes = (amplitude + 1) / 2
        return CpgParameters(
            frequency=float(middle * width ** (float(genome[0]) / 2)),
            amplitudes=amplitudes,
            offsets=offset * (1 - amplitudes),
            phases=phase / 2,
            feedback=feedback * (MAX_FEEDBACK / max(1, len(self.sensors))),
            heading=heading,
        )

    def batch(self, genomes: FloatArray, _silent: Sequence[AbstractSet[int]]) -> "CpgBatch":
        """Returns the batch of the CPGs of some genomes; see ``Design.batch``."""
        return CpgBatch(self, genomes)


@dataclass(frozen=True, eq=False)
class CpgParameters:
    """Decoded parameters of one CPG.

    Attributes:
        frequency: Stride frequency while all sensors read 0, Hz; logarithmic in its gene.
        amplitudes: Fraction of each motor's half range, 0 to 1, ``(motors,)``.
        offsets: Centre of each oscillation, as a fraction of the half range, ``(motors,)``;
            amplitude and offset together stay within the range.
        phases: Phase lead of each oscillator, in strides, -1/2 to 1/2, ``(motors,)``.
        feedback: Relative change of the phase speed per sensor reading of 1, ``(sensors,)``.
        heading: Genes of the heading hold, ``(motors,)``, or ``(0,)``.
    """

    frequency: float
    amplitudes: FloatArray
    offsets: FloatArray
    phases: FloatArray
    feedback: FloatArray
    heading: FloatArray


class CpgBatch:
    """The CPGs of many robots; a ``ControllerBatch``.

    Readings are constant between two commands, so the advance of the phase is exact.
    """

    def __init__(self, cpg: Cpg, genomes: FloatArray) -> None:
        decoded = [cpg.decode(genome) for genome in genomes]
        self._timestep = cpg.timestep
        self._scaler = CommandScaler(cpg.ranges)
        self._stride = np.array([parameters.frequency * cpg.timestep for parameters in decoded])
        self._amplitudes = np.array([parameters.amplitudes for parameters in decoded])
        self._offsets = np.array([parameters.offsets for parameters in decoded])
        self._phases = np.array([parameters.phases for parameters in decoded])
        self._feedback = np.array([parameters.feedback for parameters in decoded])
        self._phase = np.zeros(len(decoded))
        self._step = 0
        self.readings = np.zeros((len(decoded), len(cpg.sensors)))
        self._heading = HeadingHold(np.array([parameters.heading for parameters in decoded]))
        self.observed: Mapping[str, FloatArray] = self._heading.observed

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step; see ``ControllerBatch``."""
        phases = self._phase[:, np.newaxis] + self._phases
        phases -= np.floor(phases)
        outputs = np.cos(2 * np.pi * phases)
        outputs *= self._amplitudes
        self._heading.scale(outputs)
        outputs += self._offsets
        np.clip(outputs, -1, 1, out=outputs)
        # The fraction r of the final amplitude solves r'' = a (a (1 - r) / 4 - r') from rest, which
        # is critically damped, so the first commands do not jump.
        exponent = AMPLITUDE_RATE * (self._step * self._timestep) / 2
        outputs *= 1 - (1 + exponent) * math.exp(-exponent)
        self._scaler.write(outputs, targets)
        # einsum sums each row by itself, in an order that the number of rows does not change.
        speed = 1 + np.einsum("ns,ns->n", self._feedback, self.readings)
        self._phase += self._stride * speed
        self._phase -= np.floor(self._phase)
        self._step += 1

    def end(self, _running: IndexArray) -> None:
        """Changes nothing: the commands of a robot cost little."""
