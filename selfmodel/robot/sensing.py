"""Sensor readings of a controller, computed from MuJoCo's state."""

from collections.abc import Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, columns
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import Embodiment


class SensorReader:
    """Computes the readings of many robots: touch 0 or 1, angles from -1 to 1.

    Angles are read from the joint positions: after a step, MuJoCo's sensors are one physics step
    old, and updating them takes a fifth of the time of the physics.

    Args:
        model: Model of any of the robots; they share one layout.
        anatomy: Parts of the robots.
        embodiments: Embodiments with the faults of their sensors.
        copies: Number of robots per embodiment, in adjacent rows.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        anatomy: Anatomy,
        embodiments: Sequence[Embodiment],
        copies: int = 1,
    ) -> None:
        touches = [sensor for sensor in anatomy.sensors if sensor.kind == "touch"]
        angles = [sensor for sensor in anatomy.sensors if sensor.kind == "angle"]
        self._touches = len(touches)
        self._touch = columns([int(model.sensor(sensor.name).adr[0]) for sensor in touches])
        self._angle = columns([int(model.joint(sensor.hinge).qposadr[0]) for sensor in angles])
        self._centre = np.array([sensor.centre for sensor in angles])
        self._scale = np.array([1 / sensor.half_range for sensor in angles])
        gain = np.array([embodiment.gain for embodiment in embodiments])
        offset = np.array([embodiment.offset + embodiment.bias for embodiment in embodiments])
        self._faulty = bool(np.any(gain != 1) or np.any(offset != 0))
        self._gain = np.repeat(gain, copies, axis=0)
        self._offset = np.repeat(offset, copies, axis=0)
        self._noise = SensorNoise(embodiments, copies)

    def read(self, sensordata: FloatArray, qpos: FloatArray, readings: FloatArray) -> None:
        """Writes the readings of the next control step.

        Args:
            sensordata: ``(n, nsensordata)``, which contains the touch forces, N.
            qpos: ``(n, nq)``, which contains the joint angles, rad.
            readings: ``(n, sensors)``, written.
        """
        np.greater(
            sensordata[:, self._touch], 0, out=readings[:, : self._touches], casting="unsafe"
        )
        angles = readings[:, self._touches :]
        np.subtract(qpos[:, self._angle], self._centre, out=angles)
        np.multiply(angles, self._scale, out=angles)
        if self._faulty:
            readings *= self._gain
            readings += self._offset
        self._noise.add(readings)


class SensorNoise:
    """Adds white noise to the readings of many robots, step by step.

    The noise sequence of a sensor depends on the seed of the embodiment and the column of the
    sensor only. It is the same in any batch and for all hypotheses of one seed, so that hypotheses
    do not differ by their noise.

    Args:
        embodiments: Embodiments with the standard deviations of their sensors.
        copies: Number of robots per embodiment, in adjacent rows; each copy has its own sequence.
    """

    def __init__(self, embodiments: Sequence[Embodiment], copies: int = 1) -> None:
        self._copies = copies
        deviations = np.array([embodiment.noise for embodiment in embodiments])
        noisy: dict[tuple[int, int], list[int]] = {}
        for row, column in zip(*np.nonzero(deviations), strict=True):
            noisy.setdefault((embodiments[row].seed, int(column)), []).append(int(row))
        self._noisy = [
            (np.random.default_rng(key), rows, key[1], deviations[rows, key[1]])
            for key, rows in noisy.items()
        ]

    def add(self, readings: FloatArray) -> None:
        """Adds the noise of the next step to the readings, ``(embodiments * copies, sensors)``."""
        robots, sensors = readings.shape
        by_copy = readings.reshape(robots // self._copies, self._copies, sensors)
        for rng, rows, column, deviations in self._noisy:
            drawn = rng.standard_normal(self._copies)
            by_copy[rows, :, column] += np.outer(deviations, drawn)
