"""The bodies of dm_control's suite that move about, as robots."""

import importlib
import math
from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

from selfmodel.errors import unknown_name
from selfmodel.robot.mjcf.adaptation import adapt_text
from selfmodel.robot.mjcf.load import robot_from
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.tasks.entry import Entry
from selfmodel.tasks.suite_environment import SuiteRobot, episode_return

PREFIX = "suite-"
"""What the name of such a robot begins with: ``suite-walker-run``."""

DOMAINS: Mapping[str, tuple[str, ...]] = {
    "quadruped": ("walk", "run"),
    "walker": ("walk", "run", "stand"),
    "cheetah": ("run",),
    "hopper": ("hop", "stand"),
    "humanoid": ("walk", "run", "stand", "run_pure_state"),
    "humanoid_CMU": ("walk", "run", "stand"),
    "dog": ("walk", "trot", "run", "stand"),
    "swimmer": ("swimmer6", "swimmer15"),
    "fish": ("swim", "upright"),
}
"""The tasks of each domain, the one that counts first where none is named.

Left out are those with a ball to fetch, which is a second thing that moves, and the quadruped's
``escape``, whose ground is drawn anew for each episode: no self-model knows it.
"""


def names() -> tuple[str, ...]:
    """Returns the names of all these robots."""
    return tuple(name(domain, task) for domain, tasks in DOMAINS.items() for task in tasks)


def name(domain: str, task: str) -> str:
    """Returns what the body of a task is called as a robot."""
    return f"{PREFIX}{domain}-{task}"


def parse_name(text: str) -> tuple[str, str]:
    """Returns the domain and the task of a robot's name.

    Raises:
        InputError: There is none of that name; the message names the nearest.
    """
    domain, _, task = text.removeprefix(PREFIX).partition("-")
    if not text.startswith(PREFIX) or task not in DOMAINS.get(domain, ()):
        raise unknown_name("robot", text, names())
    return domain, task


def entry(domain: str, task: str) -> Entry:
    """Returns the body of a task with its failures, its environment and its return."""
    return Entry(
        robot=partial(robot, domain, task),
        physical=partial(SuiteRobot, domain, task),
        episode_return=episode_return(domain, task),
    )


@lru_cache
def robot(domain: str, task: str) -> Robot:
    """Returns the body of a task with nothing wrong, with the suite's own time steps.

    It starts as ``Physics.reset`` leaves it, without the pose that the suite draws afterwards; a
    swimmer, which lies across there, with its nose forward.

    Args:
        domain: One of ``DOMAINS``.
        task: One of its tasks.
    """
    mjcf, assets = _model(domain, task)
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    keyframe = "none"
    if domain == "swimmer":
        keyframe, text = _FORWARD, text.replace("</mujoco>", _swimmers_start(_links(task)))
    settings = MjcfSettings(keyframe=keyframe, control_timestep=control_timestep(domain))
    named = name(domain, task)
    return robot_from(adapt_text(named, text, assets, settings), named)


def control_timestep(domain: str) -> float | None:
    """Returns the seconds between two commands in a domain of the suite; None for the physics'."""
    found: float | None = getattr(_module(domain), "_CONTROL_TIMESTEP", None)
    return found


def _model(domain: str, task: str) -> tuple[str | bytes, Mapping[str, bytes]]:
    """The MJCF of a task and the files that it names, as the suite makes them.

    The size of the ground, which the suite chooses by the task, is only seen: planes are endless.
    """
    module = _module(domain)
    if domain == "quadruped":
        return module.make_model(), importlib.import_module("dm_control.suite.common").ASSETS
    size = (_links(task),) if domain == "swimmer" else ()
    found: tuple[str | bytes, Mapping[str, bytes]] = module.get_model_and_assets(*size)
    return found


def _links(task: str) -> int:
    return int(task.removeprefix("swimmer"))


def _swimmers_start(links: int) -> str:
    """A swimmer turned by a right angle; its other joints, one fewer than links, at 0."""
    qpos = f"0 0 {math.pi / 2!r}" + " 0" * (links - 1)
    return f'<keyframe><key name="{_FORWARD}" qpos="{qpos}"/></keyframe></mujoco>'


_FORWARD = "forward"


def _module(domain: str) -> Any:  # noqa: ANN401  # modules of dm_control have no types
    # When it is needed, because dm_control's physics looks for a display as it is imported.
    return importlib.import_module(f"dm_control.suite.{domain}")
