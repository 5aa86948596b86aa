"""Rewards of tasks of dm_control's suite for the states of many robots together.

They are those of ``task.get_reward``, with the constants of the suite's modules and its own
``tolerance``, which takes arrays.
"""

import importlib
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.observations import UP, Fields, to_target
from selfmodel.tasks import suite_bodies

Reward = Callable[[Fields, FloatArray], FloatArray]
"""Function from states, and the commands that led to them, ``(n, motors)``, to rewards, ``(n,)``.
"""


def _tolerance(values: FloatArray, low: float, high: float = math.inf, **shape: Any) -> FloatArray:  # noqa: ANN401  # dm_control's
    tolerance = importlib.import_module("dm_control.utils.rewards").tolerance
    return np.asarray(tolerance(values, bounds=(low, high), **shape))


def _beyond(values: FloatArray, speed: float, margin: float, at_margin: float) -> FloatArray:
    return _tolerance(values, speed, margin=margin, value_at_margin=at_margin, sigmoid="linear")


def _little(control: FloatArray) -> FloatArray:
    each = _tolerance(control, 0, 0, margin=1, value_at_margin=0, sigmoid="quadratic")
    return np.asarray((4 + each.mean(axis=1)) / 5)


def _upright(own: Fields) -> FloatArray:
    return own.body("xmat", "torso")[:, UP[0]]


def _speed(own: Fields) -> FloatArray:
    return own.sensor("torso_subtreelinvel")[:, 0]


def _walker(own: Fields, _control: FloatArray, task: Any, module: Any) -> FloatArray:  # noqa: ANN401  # dm_control's
    least, speed = module._STAND_HEIGHT, task._move_speed  # noqa: SLF001  # as for all below
    standing = _tolerance(own.body("xpos", "torso")[:, 2], least, margin=least / 2)
    stands = (3 * standing + (1 + _upright(own)) / 2) / 4
    if speed == 0:
        return np.asarray(stands)
    return np.asarray(stands * (5 * _beyond(_speed(own), speed, speed / 2, 0.5) + 1) / 6)


def _cheetah(own: Fields, _control: FloatArray, _task: Any, module: Any) -> FloatArray:  # noqa: ANN401
    return _beyond(_speed(own), module._RUN_SPEED, module._RUN_SPEED, 0)  # noqa: SLF001


def _hopper(own: Fields, control: FloatArray, task: Any, module: Any) -> FloatArray:  # noqa: ANN401
    torso, foot = (own.body("xipos", name)[:, 2] for name in ("torso", "foot"))
    standing = _tolerance(torso - foot, module._STAND_HEIGHT, 2)  # noqa: SLF001
    speed = module._HOP_SPEED  # noqa: SLF001
    hops = task._hopping  # noqa: SLF001
    moving = _beyond(_speed(own), speed, speed / 2, 0.5) if hops else _little(control)
    return np.asarray(standing * moving)


def _quadruped(own: Fields, _control: FloatArray, task: Any, _module: Any) -> FloatArray:  # noqa: ANN401
    speed = task._desired_speed  # noqa: SLF001
    moving = _beyond(own.sensor("velocimeter")[:, 0], speed, speed, 0.5)
    return np.asarray(_beyond(_upright(own), 1, 2, 0) * moving)


def _humanoid(own: Fields, control: FloatArray, task: Any, module: Any) -> FloatArray:  # noqa: ANN401
    least, speed = module._STAND_HEIGHT, task._move_speed  # noqa: SLF001
    standing = _tolerance(own.body("xpos", "head")[:, 2], least, margin=least / 4)
    stands = _little(control) * standing * _beyond(_upright(own), 0.9, 1.9, 0)
    velocity = own.sensor("torso_subtreelinvel")[:, :2]
    if speed == 0:
        return np.asarray(stands * _tolerance(velocity, 0, 0, margin=2).mean(axis=1))
    moving = _beyond(np.linalg.norm(velocity, axis=1), speed, speed, 0)
    return np.asarray(stands * (5 * moving + 1) / 6)


def _fish(own: Fields, _control: FloatArray, task: Any, _module: Any) -> FloatArray:  # noqa: ANN401
    if type(task).__name__ == "Upright":
        return _tolerance(_upright(own), 1, 1, margin=1)
    radius = float(sum(own.model.geom(name).size[0] for name in ("mouth", "target")))
    near = _tolerance(np.linalg.norm(to_target(own), axis=1), 0, radius, margin=2 * radius)
    return np.asarray((7 * near + 0.5 * (_upright(own) + 1)) / 8)


REWARDS: Mapping[str, Callable[[Fields, FloatArray, Any, Any], FloatArray]] = MappingProxyType(
    {
        "walker": _walker,
        "cheetah": _cheetah,
        "hopper": _hopper,
        "quadruped": _quadruped,
        "humanoid": _humanoid,
        "fish": _fish,
    }
)
"""Rewards by domain: functions of the states, the commands, the suite's task and its module."""


def reward_of(domain: str, task: str) -> Reward:
    """Returns the reward of a task of ``REWARDS``."""
    module = importlib.import_module(f"dm_control.suite.{domain}")
    _, own = suite_bodies.episode_parts(domain, task)
    return lambda fields, control: REWARDS[domain](fields, control, own, module)


class Starts:
    """Initial states of the episodes of a task, as the suite draws them.

    The target of a fish is drawn for each episode. As nothing but the target tells one place of its
    water from another, the fish is moved instead, and the target stays where the model has it.
    """

    def __init__(self, domain: str, task: str) -> None:
        suite = importlib.import_module("dm_control.suite")
        self._robot = suite_bodies.robot(domain, task)
        self._env = suite.load(domain, task, {"random": 0})
        self._has_target = domain == "fish"

    def draw(self, seeds: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Returns positions, ``(n, nq)``, and velocities, ``(n, nv)``, one row per seed."""
        task, physics = self._env.task, self._env.physics
        rows = []
        for seed in seeds:
            task._random = np.random.RandomState(int(seed))  # noqa: SLF001  # no other way
            self._env.reset()
            position, velocity = physics.data.qpos.copy(), physics.data.qvel.copy()
            if self._has_target:
                own, drawn = self._robot.model, physics.model.ptr
                position[:3] += own.geom("target").pos - drawn.geom("target").pos
            rows.append((position, velocity))
        positions, velocities = zip(*rows, strict=True)
        return np.array(positions), np.array(velocities)
