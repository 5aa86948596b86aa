"""The walking task as a dm_control task: the reward is the forward speed."""

import dataclasses
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.mujoco.wrapper import core
from dm_control.rl import control
from dm_control.suite import base

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.physical import simulated
from selfmodel.robot.actuators import holding_commands
from selfmodel.robot.anatomy import CONTROL_DELAY, added_steps, split_delay
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorReader, current_value, observed_fields
from selfmodel.simulation.domain import randomize_initial_pose, start_spread
from selfmodel.tasks import arguments
from selfmodel.tasks.arguments import Reality, Seed
from selfmodel.trials.signals import Signal

TIME_LIMIT = 10.0
"""Default length of an episode, s."""


def environment(
    robot: Robot,
    *,
    hypothesis: str | Hypothesis = "intact",
    time_limit: float = TIME_LIMIT,
    random: Seed = None,
    gap: float = 0.0,
    start_noise: float | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Returns the dm_control environment of the walking task.

    Without a gap and start noise, the physics, the readings and their timing equal the simulator's
    to the bit.

    The other arguments are those of ``selfmodel.tasks.load``. Silent neurons have no effect,
    because they belong to the controller. The start noise tilts the base by half of that of the
    joints.

    Raises:
        InputError: The base of the robot is fixed, its control delay has a part of a control step,
            the hypothesis cannot be parsed or does not apply, or another argument is out of range.
    """
    if robot.has_fixed_base:
        raise InputError(
            f"the reward of walk is the forward speed, and the base of {robot.name} is fixed: "
            f"give the model a <freejoint/>"
        )
    _, part = split_delay(robot.control_delay, robot.substeps)
    if part:
        raise InputError(
            f"dm_control applies commands at control steps, and the control delay of {robot.name} "
            f"is {robot.control_delay:g} of them: set {CONTROL_DELAY} to a whole number"
        )
    arguments.check_time_limit(time_limit)
    episodes, rng = arguments.random_streams(random)
    reality = arguments.draw_reality(
        robot.model, robot.anatomy, hypothesis, gap=gap, start_noise=start_noise, rng=rng
    )
    walk = Walk(robot, reality, episodes)
    return control.Environment(
        mujoco.Physics.from_model(core.MjModel(walk.variant.model)),
        walk,
        time_limit=time_limit,
        control_timestep=robot.control_timestep,
        **(environment_kwargs or {}),
    )


def motion_capture(
    environment: control.Environment,
) -> Callable[[Mapping[str, FloatArray]], Mapping[str, Any]]:
    """Returns a callable that adds base position, joint efforts and time to an observation.

    An ``EnvironmentRobot`` with this callable as ``observe`` records trials with all signals.
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

    The sum of the rewards times the control time step is the distance, m. The variant is the robot
    with the faults and the gap of its reality.
    """

    def __init__(self, robot: Robot, reality: Reality, random: np.random.RandomState) -> None:
        super().__init__(random=random)
        self._robot, self._start_level = robot, reality.start
        self._gap = reality.gap if reality.gap.level > 0 else None
        hidden = reality.hypothesis
        made = simulated.physical_variant(robot, hidden, reality.seed, self._gap)
        self.variant, self._limbs = made
        self._fields = observed_fields(robot, [self.variant])
        self._start = self._end = 0.0
        self._begin(np.random.default_rng(0))  # for the specs, before the first episode

    def _begin(self, rng: np.random.Generator) -> None:
        """Starts the random number streams and the delay line of an episode."""
        variant = dataclasses.replace(self.variant, seed=int(rng.integers(2**32)))
        self._reader = SensorReader(variant.model, self._robot.anatomy, [variant])
        self._measurement = simulated.Measurement()
        delay = int(self._robot.control_delay)
        delay += added_steps(delay, float(variant.added_delay[0]))
        if self._gap is not None:
            measured = self._gap.level, self._robot, variant, rng
            self._measurement = simulated.NoisyMeasurement(*measured)
            delay += self._gap.delay
        self._delayed = deque([holding_commands(self._robot.model)] * delay)

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Sets the initial pose, with its noise, and the position for the reward."""
        rng = np.random.default_rng(arguments.next_seed(self.random))
        self._begin(rng)
        model, data = physics.model.ptr, physics.data.ptr
        if self._start_level > 0:
            spread = start_spread(self._start_level)
            randomize_initial_pose(self._robot, data, spread, rng)
        simulated.place_debris(model, data, self._limbs)
        super().initialize_episode(physics)
        self._start = self._end = self._forward(physics)

    def before_step(self, action: FloatArray, physics: mujoco.Physics) -> None:
        """Records the position before the step, and applies the delayed motor commands."""
        self._start = self._forward(physics)
        self._delayed.append(np.array(action, dtype=np.float64))
        super().before_step(self._delayed.popleft(), physics)

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
        self._measurement.corrupt_readings(readings[0])
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
        """Returns a signal of the state as it is measured, ``(width,)``."""
        return self._measurement.measure(signal, current_value(self._fields[signal], physics.data))

    def _forward(self, physics: mujoco.Physics) -> float:
        """Position of the root body along the world's x axis, m."""
        return float(current_value(self._fields["base_position"], physics.data)[0])
