"""A simulated environment of dm_env or Gymnasium, stepped as a robot, with its rewards."""

from collections.abc import Mapping
from typing import Any

import dm_env
import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import TASK_PREFIX, CommandSource, Controller
from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.physical.environment import EnvironmentRobot, Observe, Policy
from selfmodel.robot.observations import observation_of, observation_source
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SensorReader, SignalSource, current_value, signal_fields
from selfmodel.trials.signals import SIGNALS, Signal


class Stepped:
    """An environment as ``EnvironmentRobot`` steps it.

    Its signals are those in an observation by name, and of MuJoCo's state of ``env.physics``, or of
    ``env.unwrapped.model`` and ``data``, the others. The readings of the sensors are those of the
    robot's model in that state, if the environment has the same body. The rewards are those of the
    episode so far, which ``is_over`` once the environment has ended it.
    """

    def __init__(self, env: Any, robot: Robot) -> None:  # noqa: ANN401  # of either interface
        self._env, self._robot = env, robot
        self._is_dm = hasattr(env, "action_spec")
        if not self._is_dm and not hasattr(env, "action_space"):
            raise InputError(
                f"expected a dm_env or Gymnasium environment, got {env!r:.80}: give one such as "
                f'selfmodel.tasks.load("quadruped", "walk")'
            )
        self._inner = env if self._is_dm else env.unwrapped
        own = self._inner.control_timestep() if self._is_dm else getattr(self._inner, "dt", None)
        if own is not None and not np.isclose(own, robot.control_timestep):
            raise InputError(
                f"the environment has steps of {own:g} s, and {robot.name} of "
                f"{robot.control_timestep:g} s: give the robot that control time step"
            )
        self.rewards: list[float] = []
        self.is_over = False
        self._fields: Mapping[Signal, SignalSource] = {}
        self._variant, self._reads = build(robot, INTACT), False
        self._sensors = SensorReader(self._variant.model, robot.anatomy, [self._variant])
        self._data = mujoco.MjData(self._variant.model)
        self._tasks: Mapping[str, SignalSource] = {}
        if (state := self._state) is not None:
            try:
                self._fields = signal_fields(robot, state[0])
            except (KeyError, IndexError) as error:
                if _layout(state[0]) != _layout(robot.model):
                    raise InputError(
                        f"the environment has another body than {robot.name} ({error}): give the "
                        f"robot of this body"
                    ) from error
                self._fields = signal_fields(robot)  # its motors have no names
            if key := observation_of(robot.name):
                self._tasks = {f"{TASK_PREFIX}{key}": observation_source(key, state[0])}

    def driven(
        self, observe: Observe | None, policy: Policy | None, source: CommandSource
    ) -> EnvironmentRobot:
        """Returns the robot that is stepped through the environment by a policy, or a source."""
        self._reads = isinstance(source, Controller) and source.design.reads
        return EnvironmentRobot(
            self,
            self._robot,
            observe=observe or self.observe,
            policy=policy,
            stop=lambda: None,  # nothing moves between two steps
            clock=lambda: len(self.rewards) * self._robot.control_timestep,
        )

    def action_spec(self) -> Any:  # noqa: ANN401  # a spec or a space, which have a shape
        """Returns the shape of an action, as an attribute."""
        return self._env.action_spec() if self._is_dm else self._env.action_space

    def reset(self) -> dm_env.TimeStep:
        """Starts an episode."""
        step = self._env.reset() if self._is_dm else dm_env.restart(self._env.reset()[0])
        self.rewards, self.is_over = [], False
        return step

    def step(self, action: FloatArray) -> dm_env.TimeStep:
        """Applies the commands of the motors, ``(motors,)``, for one control step."""
        if self._is_dm:
            step = self._env.step(action)
        else:
            seen, reward, terminated, truncated, _ = self._env.step(action)
            end = dm_env.termination if terminated else dm_env.truncation
            step = (end if terminated or truncated else dm_env.transition)(reward, seen)
        self.rewards.append(float(step.reward or 0))
        self.is_over = step.last()
        return step

    def observe(self, observation: Any) -> Mapping[str, Any]:  # noqa: ANN401  # of any type
        """Returns the signals of an observation and of the state."""
        named = observation if isinstance(observation, Mapping) else {}
        found: dict[str, Any] = {name: named[name] for name in SIGNALS if name in named}
        if (state := self._state) is not None:
            for name, field in (*self._fields.items(), *self._tasks.items()):
                found.setdefault(name, current_value(field, state[1]))
            if "sensors" not in found and _same_body(state[0], self._variant.model):
                found["sensors"] = self._readings(state[1])
        if self._reads and "sensors" not in found:
            names = self._robot.anatomy.names.sensors
            raise InputError(
                f"the controller reads the sensors of {self._robot.name}, and the environment has "
                f"another body, or no state of MuJoCo: give observe=, such as "
                f'lambda seen: {{"sensors": seen[:{len(names)}]}}, with touch 0 or 1 and angles '
                f"from -1 to 1, in the order {', '.join(names)}"
            )
        if not found:
            raise InputError(
                f"expected an environment with the state of MuJoCo, or observations with some of "
                f"{', '.join(SIGNALS)}: give observe=, a function of an observation to signals"
            )
        return found

    def _readings(self, state: mujoco.MjData) -> FloatArray:
        """Returns the readings of the sensors of the robot's model in a state, ``(sensors,)``."""
        data, readings = self._data, np.empty((1, len(self._robot.anatomy.sensors)))
        data.qpos[:], data.qvel[:], data.act[:] = state.qpos, state.qvel, state.act
        data.ctrl[:] = state.ctrl
        mujoco.mj_forward(self._variant.model, data)
        self._sensors.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], readings)
        return np.array(readings[0])

    @property
    def _state(self) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        physics = getattr(self._inner, "physics", None)
        if physics is not None:
            return physics.model.ptr, physics.data.ptr
        model = getattr(self._inner, "model", None)
        return (model, self._inner.data) if isinstance(model, mujoco.MjModel) else None


def _same_body(model: mujoco.MjModel, own: mujoco.MjModel) -> bool:
    """Returns whether two models have the same body; their ground and targets may differ."""
    names = ("body_mass", "body_inertia", "geom_type", "geom_contype", "jnt_type")
    limbs = [one.geom_size[one.geom_bodyid > 0] for one in (model, own)]
    same = [np.array_equal(getattr(model, name), getattr(own, name)) for name in names]
    return model.na == own.na and all(same) and np.array_equal(*limbs)


def _layout(model: mujoco.MjModel) -> tuple[list[str], int]:
    return [model.joint(joint).name for joint in range(model.njnt)], model.nu
