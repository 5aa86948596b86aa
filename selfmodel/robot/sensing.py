"""From what MuJoCo's sensors measure to what the controllers receive."""

from collections.abc import Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, columns
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.noise import SensorNoise


class SensorReader:
    """Turns the state of many robots into readings: touch 0 or 1, angles from -1 to 1.

    Angles are read from the joint positions themselves: after a step, MuJoCo's sensors are one
    physics step behind them, and bringing them up to date costs a fifth of the physics.

    Args:
        model: Any of the robots' models; they share one layout.
        anatomy: The robots' parts.
        embodiments: What is wrong with their sensors.
        copies: Robots of each embodiment, side by side.
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
            sensordata: ``(n, nsensordata)``, of which the touch forces are read, N.
            qpos: ``(n, nq)``, of which the joint angles are read, rad.
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
