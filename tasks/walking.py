"""The walking task as a dm_control task: the reward is the forward speed."""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.mujoco.wrapper import core
from dm_control.rl import control
from dm_control.suite import base

from selfmodel.arrays import FloatArray
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state_access import current_value, signal_fields
from selfmodel.trials.signals import Signal


def environment(
    robot: Robot,
    hypothesis: str | Hypothesis,
    time_limit: float,
    random: int | np.random.RandomState | None,
    environment_kwargs: dict[str, Any] | None,
) -> control.Environment:
    """Returns the dm_control environment of the walking task.

    The physics, the readings and their timing equal the simulator's to the bit.

    Args:
        robot: The healthy robot.
        hypothesis: Faults of the robot, or their notation with built-in kinds. Silent neurons have
            no effect, because they belong to the controller.
        time_limit: Length of an episode, s.
        random: Seed or generator of dm_control's tasks; walking uses no random numbers.
        environment_kwargs: Arguments of ``control.Environment``.
    """
    if isinstance(hypothesis, str):
        hypothesis = parse(hypothesis, robot.anatomy)
    embodiment = build(robot, hypothesis)
    return control.Environment(
        mujoco.Physics.from_model(core.MjModel(embodiment.model)),
        Walk(robot, embodiment, random),
        time_limit=time_limit,
        control_timestep=robot.control_timestep,
        **(environment_kwargs or {}),
    )


def motion_capture(
    environment: control.Environment,
) -> Callable[[Mapping[str, FloatArray]], Mapping[str, Any]]:
    """Returns a callable that adds base position, joint efforts and time to an observation.

    An ``EnvironmentRobot`` with this callable as ``observe`` records trials with all signals.

    Args:
        environment: The environment of the observations.
    """

    def observe(observation: Mapping[str, FloatArray]) -> Mapping[str, Any]:
        task, physics = environment.task, environment.physics
        added = {
            signal: task.observe(physics, signal) for signal in ("base_position", "joint_efforts")
        }
        return {**observation, **added, "time": physics.time()}

    return observe


class Walk(base.Task):
    """The task of walking forward; the reward is the forward speed, m/s.

    The sum of the rewards times the control time step is the distance, m.

    Args:
        robot: The healthy robot.
        embodiment: The robot with its faults.
        random: A seed or a numpy ``RandomState``.
    """

    def __init__(
        self, robot: Robot, embodiment: Embodiment, random: int | np.random.RandomState | None
    ) -> None:
        super().__init__(random=random)
        self._robot = robot
        self._embodiment = embodiment
        self._reader = SensorReader(embodiment.model, robot.anatomy, [embodiment])
        self._fields = signal_fields(robot, embodiment.model)
        self._start = self._end = 0.0

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Resets the position for the reward."""
        super().initialize_episode(physics)
        self._start = self._end = self._forward(physics)

    def before_step(self, action: FloatArray, physics: mujoco.Physics) -> None:
        """Records the position before the step, and applies the motor commands."""
        self._start = self._forward(physics)
        super().before_step(action, physics)

    def after_step(self, physics: mujoco.Physics) -> None:
        """Records the position after the step."""
        self._end = self._forward(physics)
        super().after_step(physics)

    def get_reward(self, _physics: mujoco.Physics) -> float:
        """Returns the forward speed over the last control step, m/s."""
        return (self._end - self._start) / self._robot.control_timestep

    def get_observation(self, physics: mujoco.Physics) -> "OrderedDict[str, FloatArray]":
        """Returns the sensor readings, and the state without the horizontal position."""
        readings = np.empty((1, len(self._robot.anatomy.sensors)))
        data = physics.data
        self._reader.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], readings)
        observation = OrderedDict(sensors=readings[0])
        signals: tuple[Signal, ...] = (
            "joint_positions",
            "joint_velocities",
            "base_orientation",
            "base_linear_velocity",
            "base_angular_velocity",
        )
        for signal in signals:
            observation[signal] = self.observe(physics, signal)
        observation["base_height"] = self.observe(physics, "base_position")[2:]
        return observation

    def observe(self, physics: mujoco.Physics, signal: Signal) -> FloatArray:
        """Returns a signal of the state, ``(width,)``."""
        return current_value(self._fields[signal], physics.data)

    def _forward(self, physics: mujoco.Physics) -> float:
        """Position of the root body along the world's x axis, m."""
        return float(self.observe(physics, "base_position")[0])
