"""The tasks as Gymnasium environments; importing this module registers their ids.

This is the only module that imports Gymnasium, which selfmodel does not depend on::

    import gymnasium
    import selfmodel.tasks.gymnasium_env

    gymnasium.make("selfmodel/Quadruped-walk-v0", hypothesis="break:front_left_knee")
"""

from collections.abc import Mapping
from typing import Any

import dm_env
import gymnasium
import mujoco
import numpy as np
from gymnasium import error, spaces
from gymnasium.utils import EzPickle

from selfmodel import tasks
from selfmodel.arrays import FloatArray
from selfmodel.opengl import prepare_dm_control
from selfmodel.tasks.arguments import check_names

NAMESPACE = "selfmodel"
"""Namespace of the ids."""

FILE_ID = f"{NAMESPACE}/File-v0"
"""Id of the environment of an MJCF or URDF file, with the argument ``robot``."""

PICTURE_SIZE = (480, 640)
"""Default height and width of a picture, pixels."""

Observation = dict[str, FloatArray]
"""Values by name, as the task observes them."""


class TaskEnv(gymnasium.Env[Any, Any], EzPickle):
    """A task of ``selfmodel.tasks.load`` as a Gymnasium environment.

    ``reset(seed=...)`` seeds all that is random: the gap and the terrain, which are then drawn
    anew, and the initial pose and the sensor noise of every following episode. An episode is
    truncated at the time limit, and terminated where the task ends it.

    Args:
        robot: Name of a robot or path of an MJCF or URDF file, as for ``selfmodel.tasks.load``.
        task: Name of the task.
        render_mode: ``"rgb_array"`` or None.
        height: Height of a picture, pixels.
        width: Width of a picture, pixels.
        camera: Name or number of the camera; -1 is the free camera.
        environment_kwargs: Arguments of ``dm_control.rl.control.Environment``, such as
            ``flat_observation``.
        task_kwargs: Arguments of the task, such as ``hypothesis``, ``gap``, ``start_noise`` and
            ``time_limit``.

    Raises:
        InputError: The robot, the task or an argument is not valid.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012  # Gymnasium's interface

    def __init__(
        self,
        robot: str,
        task: str = "walk",
        *,
        render_mode: str | None = None,
        height: int = PICTURE_SIZE[0],
        width: int = PICTURE_SIZE[1],
        camera: str | int = -1,
        environment_kwargs: Mapping[str, Any] | None = None,
        **task_kwargs: Any,  # noqa: ANN401  # arguments of any task
    ) -> None:
        EzPickle.__init__(
            self,
            robot,
            task,
            render_mode=render_mode,
            height=height,
            width=width,
            camera=camera,
            environment_kwargs=environment_kwargs,
            **task_kwargs,
        )
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise error.Error(f"expected the render_mode rgb_array or None, got {render_mode!r}")
        if "random" in task_kwargs:
            raise error.Error("random is not an argument here: give the seed to reset(seed=...)")
        check_names(task_kwargs)
        self.render_mode = render_mode
        self._view = {"height": height, "width": width, "camera_id": camera}
        self._make = tasks.constructor(robot, task)
        self._kwargs = {**task_kwargs, "environment_kwargs": environment_kwargs}
        self._environment = self._made()
        self._is_over = True
        self.metadata = {
            **self.metadata,
            "render_fps": round(1 / self._environment.control_timestep()),
        }
        self.observation_space = spaces.Dict(
            {name: _box(spec) for name, spec in self._environment.observation_spec().items()}
        )
        self.action_space = _box(self._environment.action_spec())

    def _made(self) -> Any:  # noqa: ANN401  # dm_control has no types
        random = np.random.RandomState(int(self.np_random.integers(2**32)))
        return self._make(random=random, **self._kwargs)

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; a seed is that of all that is random. Options are ignored."""
        super().reset(seed=seed, options=options)
        if seed is not None:
            self.physics.free()
            self._environment = self._made()
        self._is_over = False
        return _observation(self._environment.reset()), {}

    def step(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Applies the commands of the motors, ``(motors,)``, for one control step.

        Raises:
            ResetNeeded: The episode is over.
        """
        if self._is_over:
            raise error.ResetNeeded("the episode is over, or has not begun: call reset first")
        step = self._environment.step(action)
        self._is_over = step.last()
        # The discount of the last step is 1 at the time limit, and 0 where the task ends.
        terminated = bool(step.last() and step.discount == 0)
        truncated = bool(step.last() and not terminated)
        return _observation(step), float(step.reward), terminated, truncated, {}

    def render(self) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
        """Returns a picture, ``(height, width, 3)``, or None without a render mode."""
        if self.render_mode is None:
            return None
        prepare_dm_control()
        picture: np.ndarray[Any, np.dtype[np.uint8]] = self._environment.physics.render(
            **self._view
        )
        return picture

    def close(self) -> None:
        """Frees the memory of MuJoCo and of pictures."""
        self.physics.free()

    @property
    def physics(self) -> Any:  # noqa: ANN401  # dm_control has no types
        """dm_control's physics of the episode."""
        return self._environment.physics


def _box(spec: dm_env.specs.Array) -> spaces.Box:
    """Returns the space of a spec; values without bounds have those of MuJoCo's state."""
    low, high = -mujoco.mjMAXVAL, mujoco.mjMAXVAL
    if isinstance(spec, dm_env.specs.BoundedArray):
        low, high = spec.minimum, spec.maximum
    return spaces.Box(
        np.broadcast_to(low, spec.shape).astype(spec.dtype),
        np.broadcast_to(high, spec.shape).astype(spec.dtype),
        dtype=spec.dtype,
    )


def _observation(step: dm_env.TimeStep) -> Observation:
    return {name: np.asarray(values) for name, values in step.observation.items()}


def env_id(robot: str, task: str) -> str:
    """Returns the id of a task, such as ``selfmodel/Quadruped-walk-v0``."""
    name = robot.capitalize() if robot in tasks.ROBOTS else robot
    return f"{NAMESPACE}/{name}-{task}-v0"


def register() -> None:
    """Registers the ids of all tasks, and of a file, that are not registered yet."""
    ids = {env_id(robot, task): {"robot": robot, "task": task} for robot, task in tasks.ALL_TASKS}
    for name, kwargs in {**ids, FILE_ID: {}}.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=f"{__name__}:TaskEnv", kwargs=kwargs)


register()
