"""Bodies that are not ours, as robots: dm_control's, and Gymnasium's ant."""

from collections.abc import Callable, Mapping
from functools import lru_cache, partial

import numpy as np
import pytest

from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.robot import Robot
from selfmodel.tasks import suite_bodies
from tests.robot.mjcf.samples import SAMPLES

TASKS = {
    "walker": "walk",
    "cheetah": "run",
    "hopper": "hop",
    "swimmer": "swimmer6",
    "humanoid": "walk",
    "quadruped": "walk",
    "dog": "walk",
}
BODIES: Mapping[str, Callable[[], Robot]] = {
    **{domain: partial(suite_bodies.robot, domain, task) for domain, task in TASKS.items()},
    # Its hinges share no name with those beyond, and have ranges that are not about 0.
    "ant": lru_cache(partial(load_mjcf, SAMPLES["gymnasium ant"])),
}
"""Each body by its name; built once."""

EVERY_BODY = [
    name if name in ("walker", "hopper", "ant") else pytest.param(name, marks=pytest.mark.bodies)
    for name in sorted(BODIES)
]
"""The names, for a test of every body: the fast tests keep three small ones."""


def swinging(robot: Robot, steps: int) -> np.ndarray:
    """Commands that move every motor over half its range, ``(steps, motors)``."""
    low, high = robot.model.actuator_ctrlrange.T
    rng = np.random.default_rng(0)
    phase = 9.0 * np.arange(steps)[:, np.newaxis] * robot.control_timestep
    wave = np.sin(phase + rng.uniform(0, 2 * np.pi, robot.model.nu))
    return (low + high) / 2 + (high - low) / 4 * wave


def swung(robot: Robot, steps: int) -> CommandSource:
    """A driver that gives these commands."""
    return played_back(robot.anatomy.motors, swinging(robot, steps))
