"""A damaged robot in PyBullet as a ``dm_env.Environment``, the interface of a driver.

PyBullet's own position control is a velocity constraint with a largest force: up to that force it
is infinitely stiff, so the softness of a servo, on which the gaits live, would be lost. Here the
rotor is a body of its own, as in hardware: the servo controls the angle of the rotor with the gains
and the torque limits of the MJCF; the armature of the joint is its inertia, and the damping of the
joint acts on it. An elastic gear transmits the torque to the joint.
Source: M. W. Spong, Modeling and control of elastic joint robots, J. Dyn. Syst. 109 (1987).
"""

from collections import deque
from typing import Self

import dm_env
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.client import SUBSTEP
from benchmarks.other_engine.reality import Damage, Reality
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.robot.anatomy import Sensor
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import Signal

GEAR_DAMPING = 0.001
"""Damping of a gear per stiffness, s: oscillations of a lower leg end within some 10 ms."""

SIGNALS: tuple[Signal, ...] = (
    *("sensors", "joint_positions", "joint_velocities", "base_position", "base_orientation"),
    *("base_linear_velocity", "base_angular_velocity"),
)


class BulletEnvironment(dm_env.Environment):
    """A robot that obeys motor targets, and is observed through its measurements.

    Every episode has noise and an initial pose of its own, from the seed of the reality and the
    number of the episode: the n-th episodes of two equal environments are equal to the bit. An
    episode has no end.

    Environments of a reality with the same ``stream`` have the same noise.
    """

    def __init__(
        self,
        robot: Robot,
        reality: Reality,
        damage: Damage | None = None,
        stream: int = 0,
        bullet: Bullet | None = None,
    ) -> None:
        self._robot, self._reality, self._damage = robot, reality, damage or Damage()
        self._noise = np.random.SeedSequence(reality.seed, spawn_key=(1, stream))
        self._bullet = bullet or Bullet(robot, reality, self._damage)
        self._substeps = round(robot.control_timestep / self._bullet.timestep)
        self._begun = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the client of PyBullet."""
        self._bullet.close()

    def reset(self) -> dm_env.TimeStep:
        """Moves the robot near the initial pose of its model, at rest."""
        (child,) = self._noise.spawn(1)
        rng, hinges = np.random.default_rng(child), self._robot.anatomy.hinges
        self._bullet.reset()
        limits = np.array([self._robot.model.joint(name).range for name in hinges])
        angles = np.clip(self._reality.start_angle * rng.standard_normal(len(hinges)), *limits.T)
        self._place(angles, self._reality.start_tilt * rng.standard_normal(2))
        self._measurements = Measurements(self._robot, self._reality, self._damage, rng, angles)
        self._servos = Servos(self._robot, self._reality, self._bullet.hinges()[0])
        self._targets = np.zeros(self._robot.model.nu)
        self._sent: deque[tuple[int, np.ndarray]] = deque()
        self._substep, self._begun = 0, True
        return dm_env.restart(self._observation())

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Sends motor targets, and advances by a control step; the reward is the speed, m/s."""
        if not self._begun:
            return self.reset()
        before = self._bullet.base()[0][0]
        self._sent.append((self._substep + self._reality.delay, np.array(action, dtype=np.float64)))
        for _ in range(self._substeps):
            while self._sent and self._sent[0][0] <= self._substep:
                _, self._targets = self._sent.popleft()
            self._drive()
            self._substep += 1
        if not self._bullet.is_valid():
            time = self._substep * self._bullet.timestep
            raise FloatingPointError(f"PyBullet's simulation diverged before {time:.3f} s")
        observation = self._observation()
        speed = (self._bullet.base()[0][0] - before) / self._robot.control_timestep
        return dm_env.transition(float(speed), observation)

    def _drive(self) -> None:
        """Advances by a substep towards the targets."""
        self._bullet.step(self._servos.step(self._targets, *self._bullet.hinges()))

    def stop(self) -> None:
        """Drops the targets on their way, and commands the initial pose."""
        if self._begun:
            self._sent.clear()
            self._targets = np.zeros(self._robot.model.nu)

    def action_spec(self) -> dm_env.specs.BoundedArray:
        """Returns the spec of an action: motor targets, rad."""
        low, high = self._robot.model.actuator_ctrlrange.T
        return dm_env.specs.BoundedArray(low.shape, np.float64, low, high, "targets")

    def observation_spec(self) -> dict[str, dm_env.specs.Array]:
        """Returns the specs of an observation: the signals, and the time of the simulation, s."""
        width = self._robot.anatomy.names.width
        array = dm_env.specs.Array
        specs = {"time": array((), np.float64, "time")}
        return specs | {signal: array((width(signal),), np.float64, signal) for signal in SIGNALS}

    def _place(self, angles: np.ndarray, tilt: np.ndarray) -> None:
        """Places the robot in a pose, lifted so that no part is in the ground."""
        root = self._robot.model.body(self._robot.root)
        turn = Rotation.from_quat(root.quat, scalar_first=True) * Rotation.from_rotvec([*tilt, 0])
        orientation = turn.as_quat(scalar_first=True)
        self._bullet.place(root.pos, orientation, angles)
        lifted = root.pos + np.array([0, 0, self._bullet.depth()])
        self._bullet.place(lifted, orientation, angles)

    def _observation(self) -> dict[str, np.ndarray]:
        time = np.array(self._substep * self._bullet.timestep)
        return {**self._measurements.observe(self._bullet), "time": time}


def physical_robot(environment: BulletEnvironment, robot: Robot) -> EnvironmentRobot:
    """Returns the environment as a physical robot, which is all that recovery has of it."""
    return EnvironmentRobot(environment, robot, stop=environment.stop)


class Servos:
    """The servos of a robot in motion, which begins at rest at some angles, rad."""

    def __init__(self, robot: Robot, reality: Reality, angles: np.ndarray) -> None:
        model = robot.model
        joints = model.actuator_trnid[:, 0]
        dofs = model.jnt_dofadr[joints]
        self._driven = [robot.anatomy.hinges.index(model.joint(joint).name) for joint in joints]
        self._stiffness, self._damping = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
        self._limit, self._factor = model.actuator_forcerange[:, 1], np.array(reality.torques)
        self._inertia, self._friction = model.dof_armature[dofs], model.dof_damping[dofs]
        self._gear_stiffness = reality.gear_stiffness
        self._angles, self._speeds = angles[self._driven], np.zeros(model.nu)

    def step(self, targets: np.ndarray, angles: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """Returns the torques of the gears on the hinges over a substep, N m, from SI units."""
        torque = self._stiffness * (targets - self._angles) - self._damping * self._speeds
        torque = np.clip(self._factor * torque, -self._limit, self._limit)
        slip = self._speeds - speeds[self._driven]
        gear = self._gear_stiffness * (self._angles - angles[self._driven] + GEAR_DAMPING * slip)
        acceleration = (torque - self._friction * self._speeds - gear) / self._inertia
        self._speeds = self._speeds + SUBSTEP * acceleration
        self._angles = self._angles + SUBSTEP * self._speeds
        torques = np.zeros(len(angles))
        torques[self._driven] = gear
        return torques


class Measurements:
    """The measurements of one trial, with noise and lost encoders.

    The encoder and the angle sensor of an absent hinge hold the last value that they measured, at
    the start; a driver repeats it when the encoder no longer answers. A fixed hinge is measured at
    its angle, with noise.

    ``start`` has the angle of each hinge, absent ones included, at the start, rad.
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
        self._is_lost_sensor = np.array([s.hinge in damage.lost for s in self._sensors])
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
