"""The walking task: get forward, in the form of a dm_control task."""

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
from selfmodel.trials.behaviour import Signal


def environment(
    robot: Robot,
    hypothesis: str | Hypothesis,
    time_limit: float,
    random: int | np.random.RandomState | None,
    environment_kwargs: dict[str, Any] | None,
) -> control.Environment:
    """Returns the environment in which a robot walks.

    The physics, the readings and their timing are those of the simulator, to the bit.

    Args:
        robot: The robot with nothing wrong.
        hypothesis: What is to be wrong, or its notation, which can name what comes with selfmodel;
            silent neurons are the controller's affair and change nothing here.
        time_limit: Length of an episode, s.
        random: For dm_control's tasks; walking starts from one place, so nothing depends on it.
        environment_kwargs: For ``control.Environment``.
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
    """Returns what adds to an observation what a robot does not see: where it is, torques, time.

    With it as ``observe``, an ``EnvironmentRobot`` has trials of all signals.

    Args:
        environment: The one that the observations are of.
    """

    def observe(observation: Mapping[str, FloatArray]) -> Mapping[str, Any]:
        task, physics = environment.task, environment.physics
        seen = {
            signal: task.observe(physics, signal) for signal in ("base_position", "joint_efforts")
        }
        return {**observation, **seen, "time": physics.time()}

    return observe


class Walk(base.Task):
    """Rewards forward speed, m/s: the sum of the rewards times the time step is the distance.

    Args:
        robot: The robot with nothing wrong.
        embodiment: The same with what is wrong.
        random: A seed or a numpy ``RandomState``.
    """

    def __init__(
        self, robot: Robot, embodiment: Embodiment, random: int | np.random.RandomState | None
    ) -> None:
        super().__init__(random=random)
        self._robot = robot
        self._embodiment = embodiment
        self._senses = SensorReader(embodiment.model, robot.anatomy, [embodiment])
        self._places = signal_fields(robot, embodiment.model)
        self._start = self._end = 0.0

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Puts the robot at its start."""
        super().initialize_episode(physics)
        self._start = self._end = self._forward(physics)

    def before_step(self, action: FloatArray, physics: mujoco.Physics) -> None:
        """Takes the commands of the motors."""
        self._start = self._forward(physics)
        super().before_step(action, physics)

    def after_step(self, physics: mujoco.Physics) -> None:
        """Sees where the step led."""
        self._end = self._forward(physics)
        super().after_step(physics)

    def get_reward(self, _physics: mujoco.Physics) -> float:
        """Returns the forward speed over the last control step, m/s."""
        return (self._end - self._start) / self._robot.control_timestep

    def get_observation(self, physics: mujoco.Physics) -> "OrderedDict[str, FloatArray]":
        """Returns what the controller receives, and the rest of the state but for where it is."""
        readings = np.empty((1, len(self._robot.anatomy.sensors)))
        data = physics.data
        self._senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], readings)
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
        """Returns a signal of the physics' state, ``(width,)``."""
        return current_value(self._places[signal], physics.data)

    def _forward(self, physics: mujoco.Physics) -> float:
        """Where the root body is along the world's x axis, m."""
        return float(self.observe(physics, "base_position")[0])
