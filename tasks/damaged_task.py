"""A task of dm_control's suite on a damaged body."""

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.embodiment import Embodiment
from selfmodel.simulation.initial_pose import randomize_joint_angles, start_spread
from selfmodel.tasks.randomness import next_seed

if TYPE_CHECKING:
    from dm_control.mujoco import Physics
    from dm_control.suite.base import Task


class DamagedTask:
    """A task of the suite with welded joints at their angles, a control delay and start noise.

    Observations, rewards and the end of an episode are the suite's.

    Args:
        task: The suite's task; all other attributes are delegated to it.
        embodiment: The body with its faults.
        anatomy: Parts of the body.
        delay: Control delay, control steps.
        start: Noise of the initial joint angles, as a gap level.
    """

    def __init__(
        self, task: "Task", embodiment: Embodiment, anatomy: Anatomy, delay: int, start: float
    ) -> None:
        self._task = task
        self._embodiment, self._anatomy = embodiment, anatomy
        self._delay, self._start = delay, start

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # attributes of the suite's task
        if name == "_task":  # a copy has no attributes yet
            raise AttributeError(name)
        return getattr(self._task, name)

    @property
    def visualize_reward(self) -> bool:
        """Whether the colours of the body show the reward."""
        return bool(self._task.visualize_reward)

    @visualize_reward.setter
    def visualize_reward(self, value: bool) -> None:
        self._task.visualize_reward = value

    @property
    def _random(self) -> np.random.RandomState:
        """Generator of the episodes, which Shimmy replaces to seed a task."""
        random: np.random.RandomState = self._task.random
        return random

    @_random.setter
    def _random(self, value: np.random.RandomState) -> None:
        self._task._random = value  # noqa: SLF001  # dm_control has no other way to seed a task

    def initialize_episode(self, physics: "Physics") -> None:
        """Draws the suite's initial state, adds the start noise and keeps welded joints welded."""
        self._task.initialize_episode(physics)
        model, data = physics.model.ptr, physics.data.ptr
        if self._start > 0:
            rng = np.random.default_rng(next_seed(self._task.random))
            spread = start_spread(self._start)
            randomize_joint_angles(self._anatomy, model, data, spread.angles, rng)
        for position, velocity, angle in self._embodiment.welded:
            data.qpos[position], data.qvel[velocity] = angle, 0.0
        self._delayed = deque(np.zeros((self._delay, model.nu)))

    def before_step(self, action: FloatArray, physics: "Physics") -> None:
        """Applies the commands of some control steps ago."""
        self._delayed.append(np.array(action, dtype=np.float64))
        self._task.before_step(self._delayed.popleft(), physics)
