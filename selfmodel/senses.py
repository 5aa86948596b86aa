"""From what MuJoCo's sensors measure to what the controllers receive."""

from collections.abc import Sequence

import mujoco
import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.arrays import FloatArray, columns
from selfmodel.embodiment import Embodiment


class Senses:
    """Turns the sensor data of many robots into readings: touch 0 or 1, angles over half range.

    Args:
        model: Any of the robots' models; they share one layout.
        anatomy: The robots' parts.
        embodiments: One a robot: what is wrong with its sensors.
    """

    def __init__(
        self, model: mujoco.MjModel, anatomy: Anatomy, embodiments: Sequence[Embodiment]
    ) -> None:
        addresses = [int(model.sensor(sensor.name).adr[0]) for sensor in anatomy.sensors]
        self._touches = sum(sensor.kind == "touch" for sensor in anatomy.sensors)
        self._touch = columns(addresses[: self._touches])
        self._angle = columns(addresses[self._touches :])
        self._scale = np.array([1 / sensor.half_range for sensor in anatomy.sensors])
        self._scale = self._scale[self._touches :]
        gain = np.array([embodiment.gain for embodiment in embodiments])
        offset = np.array([embodiment.offset for embodiment in embodiments])
        self._faulty = bool(np.any(gain != 1) or np.any(offset != 0))
        self._gain, self._offset = gain, offset

    def read(self, sensordata: FloatArray, readings: FloatArray) -> None:
        """Writes the readings.

        Args:
            sensordata: ``(n, nsensordata)`` as MuJoCo measures it: N, rad.
            readings: ``(n, sensors)``, written.
        """
        readings[:, : self._touches] = sensordata[:, self._touch] > 0
        np.multiply(sensordata[:, self._angle], self._scale, out=readings[:, self._touches :])
        if self._faulty:
            readings *= self._gain
            readings += self._offset
