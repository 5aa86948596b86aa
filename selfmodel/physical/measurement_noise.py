"""The instruments of a physical robot: what they make of its state on the way to who reads it."""

from typing import Protocol

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import WELD_ARMATURE, Embodiment
from selfmodel.trials.behaviour import Signal
from selfmodel.trials.signal_scales import MEASUREMENT_FULL_SCALES


class Measurement(Protocol):
    """Turns what is into what is received and logged."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Turns the readings, ``(sensors,)``, into those that the controller gets, in place."""
        ...

    def measure(self, signal: Signal, values: FloatArray) -> FloatArray:
        """Returns what is logged of a row of a signal, ``(width,)``; it may be the row itself."""
        ...


class ExactMeasurement:
    """Instruments that tell what is."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Leaves the readings."""

    def measure(self, _signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the values."""
        return values


class NoisyMeasurement:
    """Instruments with white noise, of a part of their full scale.

    An angle reading gets normal noise of ``level`` (half its range reads as 1). A touch reading is
    wrong with a probability of ``level / 2``. A sensor that is dead reads exactly 0. What is
    logged of a joint comes from an instrument of its own, with noise of its own.

    Args:
        level: Standard deviation of the noise, as a part of the full scale.
        anatomy: The robot's parts.
        embodiment: The robot with what is wrong with it.
        rng: Where the noise is drawn from.
    """

    def __init__(
        self, level: float, anatomy: Anatomy, embodiment: Embodiment, rng: np.random.Generator
    ) -> None:
        self._level, self._rng = level, rng
        self._dead = dead_sensors(anatomy, embodiment)
        self._touch = np.array([sensor.kind == "touch" for sensor in anatomy.sensors])
        ranges = [embodiment.model.joint(hinge).range for hinge in anatomy.hinges]
        # A hinge without limits turns half way round to either side.
        self._half_ranges = np.array([(high - low) / 2 or np.pi for low, high in ranges])

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Adds noise to the readings."""
        # The same numbers are drawn whatever is dead, so that a fault moves no other noise.
        wrong = self._rng.random(readings.shape) < self._level / 2
        noise = self._level * self._rng.standard_normal(readings.shape)
        flipped = np.where(wrong, 1 - readings, readings)
        noisy = np.where(self._touch, flipped, readings + noise)
        readings[:] = np.where(self._dead, 0.0, noisy)

    def measure(self, signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the values with noise."""
        if signal in ("sensors", "commands"):
            return values
        if signal == "base_orientation":
            turn = self._level * MEASUREMENT_FULL_SCALES[signal] * self._rng.standard_normal(3)
            return turned(values, turn)
        joints = signal == "joint_positions"
        scale = self._half_ranges if joints else MEASUREMENT_FULL_SCALES[signal]
        return np.asarray(values + self._level * scale * self._rng.standard_normal(values.shape))


def dead_sensors(anatomy: Anatomy, embodiment: Embodiment) -> BoolArray:
    """Returns which sensors give no signal at all, ``(sensors,)``.

    The sensor of a joint that is held at 0 reads 0 too, but it works.
    """
    model = embodiment.model
    held = [
        bool(sensor.hinge)
        and bool(model.dof_armature[model.joint(sensor.hinge).dofadr[0]] == WELD_ARMATURE)
        for sensor in anatomy.sensors
    ]
    silent = (embodiment.gain == 0) & (embodiment.offset == 0)
    return np.asarray(silent & ~np.array(held, dtype=bool))


def turned(orientation: FloatArray, turn: FloatArray) -> FloatArray:
    """Returns an orientation (w x y z) turned by a rotation vector in its own frame, rad."""
    by, result = np.array([1.0, 0, 0, 0]), np.empty(4)
    mujoco.mju_quatIntegrate(by, turn, 1.0)
    mujoco.mju_mulQuat(result, orientation, by)
    mujoco.mju_normalize4(result)
    return result
