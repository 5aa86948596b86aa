"""Measurement noise of a physical robot: on the controller's readings and on logged signals."""

from typing import Protocol

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.anatomy_reader import joint_limits
from selfmodel.robot.embodiment import WELD_ARMATURE, Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, Signal


class Measurement(Protocol):
    """Measurement model: from true values to received readings and logged signals."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Replaces true readings, ``(sensors,)``, by the readings that the controller receives."""
        ...

    def measure(self, signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the logged row of a signal, ``(width,)``; it may be ``values`` itself."""
        ...


class ExactMeasurement:
    """Noise-free measurements."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Leaves the readings unchanged."""

    def measure(self, _signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the values unchanged."""
        return values


class NoisyMeasurement:
    """Measurements with white noise in proportion to the full scale of each signal.

    An angle reading has normal noise with a standard deviation of ``level`` (half of the range is a
    reading of 1). A touch reading is flipped with a probability of ``level / 2``. A dead sensor
    reads exactly 0. Logged joint positions have noise independent of the readings.

    Args:
        level: Standard deviation of the noise, as a fraction of the full scale.
        robot: The healthy robot.
        embodiment: Model of the robot with its faults.
        rng: Random numbers of the noise.
    """

    def __init__(
        self, level: float, robot: Robot, embodiment: Embodiment, rng: np.random.Generator
    ) -> None:
        self._level, self._rng = level, rng
        self._dead = dead_sensors(robot.anatomy, embodiment)
        self._touch = np.array([sensor.kind == "touch" for sensor in robot.anatomy.sensors])
        hinges = [robot.model.joint(name).id for name in robot.anatomy.hinges]
        # MuJoCo leaves the range of an unlimited hinge in degrees, if the MJCF is in degrees.
        ranges = [joint_limits(robot.model, hinge) for hinge in hinges]
        self._half_ranges = np.array([(high - low) / 2 for low, high in ranges])

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Adds noise to the readings."""
        # The draws do not depend on the dead sensors: a fault leaves all other noise unchanged.
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
            return rotated_by_vector(values, turn)
        joints = signal == "joint_positions"
        scale = self._half_ranges if joints else MEASUREMENT_FULL_SCALES[signal]
        return np.asarray(values + self._level * scale * self._rng.standard_normal(values.shape))


def dead_sensors(anatomy: Anatomy, embodiment: Embodiment) -> BoolArray:
    """Returns a mask of the sensors without any signal, ``(sensors,)``.

    The sensor of a joint that is welded at 0 reads 0 too, but is not dead.
    """
    model = embodiment.model
    welded = [
        bool(sensor.hinge)
        and bool(model.dof_armature[model.joint(sensor.hinge).dofadr[0]] == WELD_ARMATURE)
        for sensor in anatomy.sensors
    ]
    silent = (embodiment.gain == 0) & (embodiment.offset == 0)
    return np.asarray(silent & ~np.array(welded, dtype=bool))


def rotated_by_vector(orientation: FloatArray, vector: FloatArray) -> FloatArray:
    """Returns an orientation (w x y z) rotated by a rotation vector in the body frame, rad."""
    rotation, result = np.array([1.0, 0, 0, 0]), np.empty(4)
    mujoco.mju_quatIntegrate(rotation, vector, 1.0)
    mujoco.mju_mulQuat(result, orientation, rotation)
    mujoco.mju_normalize4(result)
    return result
