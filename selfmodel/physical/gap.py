"""Reality gap of a physical robot: its draw, and the noise of measurements.

``simulation.reality_gap`` has the model with the factors of a gap, which ensembles of self-models
share, and ``simulation.domain`` the random initial poses.
"""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy_reader import joint_limits
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.simulation.domain import dead_sensors, rotated_by_vector
from selfmodel.simulation.reality_gap import RealityGap, draw_gap_of
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, Signal


def draw_gap(robot: Robot, level: float, rng: np.random.Generator) -> RealityGap:
    """Returns a random reality gap for a robot; see ``draw_gap_of``.

    Args:
        robot: The robot as its model describes it.
        level: 0 to ``MAX_GAP_LEVEL``; at 0 every factor is 1.
        rng: Random numbers of the gap.

    Raises:
        InputError: The level is out of range.
    """
    return draw_gap_of(robot.model, robot.anatomy, level, rng)


class Measurement:
    """Measurements without noise, from true values to received readings and logged signals."""

    def corrupt_readings(self, readings: FloatArray) -> None:
        """Replaces true readings, ``(sensors,)``, by the readings that the controller receives."""

    def measure(self, _signal: Signal, values: FloatArray) -> FloatArray:
        """Returns the logged row of a signal, ``(width,)``; it may be ``values`` itself."""
        return values


class NoisyMeasurement(Measurement):
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
