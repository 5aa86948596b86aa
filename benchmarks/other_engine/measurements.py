"""Measurements of a robot: sensors, encoders and motion capture, with noise and lost encoders."""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.damage import Damage
from benchmarks.other_engine.reality import Reality
from selfmodel.robot.anatomy import Sensor
from selfmodel.robot.robot import Robot


class Measurements:
    """The measurements of one trial.

    The encoder and the angle sensor of an absent hinge hold the last value that they measured, at
    the start; a driver repeats it when the encoder no longer answers. A fixed hinge is measured at
    its angle, with noise.

    Args:
        robot: The healthy robot.
        reality: Levels of the noise.
        damage: Absent hinges and dead sensors.
        rng: Random numbers of the noise.
        start: Angle of each hinge, absent ones included, at the start, rad.
    """

    def __init__(
        self,
        robot: Robot,
        reality: Reality,
        damage: Damage,
        rng: np.random.Generator,
        start: np.ndarray,
    ) -> None:
        self._sensors, self._dead = robot.anatomy.sensors, damage.dead
        self._reality, self._rng, self._start = reality, rng, start
        self._hinges = robot.anatomy.hinges
        self._lost = np.array([hinge in damage.lost for hinge in self._hinges])
        lost_sensors = [sensor.hinge in damage.lost for sensor in self._sensors]
        self._is_lost_sensor = np.array(lost_sensors)
        self._held_angles: np.ndarray | None = None
        self._held_readings: np.ndarray | None = None

    def observe(self, bullet: Bullet) -> dict[str, np.ndarray]:
        """Returns an observation of ``EnvironmentRobot``, without its time."""
        reality, noise = self._reality, self._rng.standard_normal
        angles, speeds = bullet.hinges()
        angles = np.where(self._lost, self._start, angles)
        position, orientation, velocity, turn = bullet.base()
        measured = angles + reality.encoder_noise * noise(angles.shape)
        if self._held_angles is None:
            self._held_angles = measured
        measured = np.where(self._lost, self._held_angles, measured)
        speed = speeds + reality.speed_noise * noise(speeds.shape)
        tilt = Rotation.from_rotvec(reality.tilt_noise * noise(3))
        return {
            "sensors": self._readings(bullet, angles),
            "joint_positions": measured,
            "joint_velocities": np.where(self._lost, 0.0, speed),
            "base_position": position + reality.position_noise * noise(3),
            "base_orientation": (orientation * tilt).as_quat(scalar_first=True),
            "base_linear_velocity": velocity + reality.velocity_noise * noise(3),
            "base_angular_velocity": turn + reality.turn_noise * noise(3),
        }

    def _readings(self, bullet: Bullet, angles: np.ndarray) -> np.ndarray:
        """Returns the readings of the controller's sensors, ``(sensors,)``."""
        touches, by_hinge = bullet.touches(), dict(zip(self._hinges, angles, strict=True))
        # Both are drawn for every sensor, so that damage leaves the noise of the others unchanged.
        flips = self._rng.random(len(self._sensors)) < self._reality.touch_flips
        # The range of a reading is 2: from -1 to 1.
        noise = 2 * self._reality.angle_noise * self._rng.standard_normal(len(self._sensors))

        def reading(sensor: Sensor, flipped: np.bool_, added: float) -> float:
            if sensor.name in self._dead:
                return 0.0
            if sensor.kind == "touch":
                return float(touches[sensor.name] != flipped)
            return sensor.reading(by_hinge[sensor.hinge]) + added

        readings = np.array(list(map(reading, self._sensors, flips, noise)))
        if self._held_readings is None:
            self._held_readings = readings
        return np.where(self._is_lost_sensor, self._held_readings, readings)
