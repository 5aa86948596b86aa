"""A damaged robot in PyBullet as a ``dm_env.Environment``, the interface of a driver."""

from collections import deque
from typing import Self

import dm_env
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.damage import Damage
from benchmarks.other_engine.measurements import Measurements
from benchmarks.other_engine.reality import SUBSTEP, Reality
from benchmarks.other_engine.servos import Servos, motors_of
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.robot.robot import Robot


class BulletEnvironment(dm_env.Environment):
    """A robot that obeys motor targets, and is observed through its measurements.

    Every episode has noise and an initial pose of its own, from the seed of the reality and the
    number of the episode: the n-th episodes of two equal environments are equal to the bit. An
    episode has no end.

    Args:
        robot: The healthy robot.
        reality: What distinguishes this robot from its model.
        damage: Its damage.
        stream: Number of the environment among those of the reality; those with the same number
            have the same noise.
    """

    def __init__(
        self, robot: Robot, reality: Reality, damage: Damage | None = None, stream: int = 0
    ) -> None:
        self._robot, self._reality, self._damage = robot, reality, damage or Damage()
        self._noise = np.random.SeedSequence(reality.seed, spawn_key=(1, stream))
        self._substeps = round(robot.control_timestep / SUBSTEP)
        self._motors = motors_of(robot, reality)
        hinges = robot.anatomy.hinges
        self._driven = np.array([hinges.index(name) for name in self._motors.hinges])
        self._bullet = Bullet(robot, reality, self._damage)
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
        rng, reality, hinges = (
            np.random.default_rng(child),
            self._reality,
            self._robot.anatomy.hinges,
        )
        self._bullet.reset()
        limits = np.array([self._robot.model.joint(name).range for name in hinges])
        angles = np.clip(reality.start_angle * rng.standard_normal(len(hinges)), *limits.T)
        self._place(angles, reality.start_tilt * rng.standard_normal(2))
        self._measurements = Measurements(self._robot, reality, self._damage, rng, angles)
        self._servos = Servos(self._motors, self._bullet.hinges()[0][self._driven])
        self._targets = np.zeros(len(self._motors.hinges))
        self._sent: deque[tuple[int, np.ndarray]] = deque()
        self._substep, self._begun = 0, True
        return dm_env.restart(self._observation())

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Sends motor targets, and advances by a control time step; the reward is the speed, m/s.

        Raises:
            FloatingPointError: The simulation diverged.
        """
        if not self._begun:
            return self.reset()
        before = self._bullet.base()[0][0]
        self._sent.append((self._substep + self._reality.delay, np.array(action, dtype=np.float64)))
        for _ in range(self._substeps):
            while self._sent and self._sent[0][0] <= self._substep:
                _, self._targets = self._sent.popleft()
            self._advance()
        if not self._bullet.is_valid():
            raise FloatingPointError(f"PyBullet's simulation diverged before {self._time:.3f} s")
        observation = self._observation()
        speed = (self._bullet.base()[0][0] - before) / self._robot.control_timestep
        return dm_env.transition(float(speed), observation)

    def stop(self) -> None:
        """Drops the targets on their way, and commands the initial pose."""
        if self._begun:
            self._sent.clear()
            self._targets = np.zeros(len(self._motors.hinges))

    def action_spec(self) -> dm_env.specs.BoundedArray:
        """Returns the spec of an action: motor targets, rad."""
        low, high = self._robot.model.actuator_ctrlrange.T
        return dm_env.specs.BoundedArray(low.shape, np.float64, low, high, "targets")

    def observation_spec(self) -> dict[str, dm_env.specs.Array]:
        """Returns the specs of an observation: the signals, and the time of the simulation, s."""
        names = self._robot.anatomy.names
        signals = {
            signal: dm_env.specs.Array((names.width(signal),), np.float64, signal)
            for signal in (
                *("sensors", "joint_positions", "joint_velocities"),
                *("base_position", "base_orientation"),
                *("base_linear_velocity", "base_angular_velocity"),
            )
        }
        return {**signals, "time": dm_env.specs.Array((), np.float64, "time")}

    def _place(self, angles: np.ndarray, tilt: np.ndarray) -> None:
        """Places the robot in a pose, lifted so that no part is in the ground."""
        root = self._robot.model.body(self._robot.root)
        turn = Rotation.from_quat(root.quat, scalar_first=True) * Rotation.from_rotvec([*tilt, 0])
        orientation = turn.as_quat(scalar_first=True)
        self._bullet.place(root.pos, orientation, angles)
        lifted = root.pos + np.array([0, 0, self._bullet.depth()])
        self._bullet.place(lifted, orientation, angles)

    def _advance(self) -> None:
        angles, speeds = self._bullet.hinges()
        torques = np.zeros(len(angles))
        torques[self._driven] = self._servos.step(
            self._targets, angles[self._driven], speeds[self._driven]
        )
        self._bullet.step(torques)
        self._substep += 1

    def _observation(self) -> dict[str, np.ndarray]:
        return {**self._measurements.observe(self._bullet), "time": np.array(self._time)}

    @property
    def _time(self) -> float:
        """Time since the reset, s."""
        return self._substep * SUBSTEP


def physical_robot(environment: BulletEnvironment, robot: Robot) -> EnvironmentRobot:
    """Returns the environment as a physical robot, which is all that recovery has of it."""
    return EnvironmentRobot(environment, robot, stop=environment.stop)
