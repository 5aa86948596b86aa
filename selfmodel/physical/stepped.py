"""A simulated environment of dm_env or Gymnasium, stepped as a robot, with its rewards."""

from collections.abc import Callable, Mapping
from typing import Any

import dm_env
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import TASK_PREFIX
from selfmodel.errors import InputError
from selfmodel.physical.environment import EnvironmentRobot, Observe
from selfmodel.robot.observations import observation_of, observation_source
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import SignalSource, current_value, signal_fields
from selfmodel.trials.signals import SIGNALS, Signal

Policy = Callable[[Any], ArrayLike]
"""Function from an observation of an environment, as it is, to its action, the motor targets."""


class Stepped:
    """An environment as ``EnvironmentRobot`` steps it.

    Its signals are those in an observation by name, and of MuJoCo's state of ``env.physics``, or of
    ``env.unwrapped.model`` and ``data``, the others but the readings of the sensors.

    Attributes:
        rewards: Rewards of the episode so far.
        is_over: Whether the environment has ended the episode.
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

    def driven(self, observe: Observe | None, policy: Policy | None) -> EnvironmentRobot:
        """Returns the robot that is stepped through the environment, by a policy if given."""
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
        if not found:
            raise InputError(
                f"expected an environment with the state of MuJoCo, or observations with some of "
                f"{', '.join(SIGNALS)}: give observe=, a function of an observation to signals"
            )
        return found

    @property
    def _state(self) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        physics = getattr(self._inner, "physics", None)
        if physics is not None:
            return physics.model.ptr, physics.data.ptr
        model = getattr(self._inner, "model", None)
        return (model, self._inner.data) if isinstance(model, mujoco.MjModel) else None


def _layout(model: mujoco.MjModel) -> tuple[list[str], int]:
    """Returns the names of the joints, in order, and the number of motors."""
    return [model.joint(joint).name for joint in range(model.njnt)], model.nu
