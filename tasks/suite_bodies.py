"""The locomotion bodies of dm_control's suite as robots."""

import importlib
import math
from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import mujoco

from selfmodel.errors import unknown_name
from selfmodel.robot.mjcf.adaptation import adapt_text
from selfmodel.robot.mjcf.document.document import read_document
from selfmodel.robot.mjcf.document.files import InMemory
from selfmodel.robot.mjcf.load import robot_from
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.robot.robot import Robot
from selfmodel.tasks.entry import Entry
from selfmodel.tasks.suite_environment import SuiteRobot, episode_return

PREFIX = "suite-"
"""Prefix of the robots' names, as in ``suite-walker-run``."""

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
"""Tasks by domain; the first is the default.

Tasks with a ball are omitted, because the ball is a second free body, and so is the quadruped's
``escape``, because its terrain is random in each episode and unknown to a self-model.
"""


def names() -> tuple[str, ...]:
    """Returns the names of all robots of the suite."""
    return tuple(name(domain, task) for domain, tasks in DOMAINS.items() for task in tasks)


def name(domain: str, task: str) -> str:
    """Returns the robot's name of the body of a task."""
    return f"{PREFIX}{domain}-{task}"


def parse_name(text: str) -> tuple[str, str]:
    """Returns the domain and the task of a robot's name.

    Raises:
        InputError: The name is unknown; the message contains the nearest one.
    """
    domain, _, task = text.removeprefix(PREFIX).partition("-")
    if not text.startswith(PREFIX) or task not in DOMAINS.get(domain, ()):
        raise unknown_name("robot", text, names())
    return domain, task


def entry(domain: str, task: str) -> Entry:
    """Returns the registry entry of the body of a task, with its environment and its return."""
    return Entry(
        robot=partial(robot, domain, task),
        physical=partial(SuiteRobot, domain, task),
        episode_return=episode_return(domain, task),
    )


@lru_cache
def robot(domain: str, task: str) -> Robot:
    """Returns the healthy body of a task, with the suite's own time steps.

    The initial pose is that of ``Physics.reset``, without the random pose of the suite's episodes.
    A swimmer is rotated by a right angle, so that its nose points forward.

    Args:
        domain: One of ``DOMAINS``.
        task: One of its tasks.
    """
    mjcf, assets = _model(domain, task)
    text = mjcf.decode() if isinstance(mjcf, bytes) else mjcf
    keyframe = "none"
    if domain == "swimmer":
        keyframe, text = _FORWARD, text.replace("</mujoco>", _swimmer_keyframe(_links(task)))
    settings = MjcfSettings(keyframe=keyframe, control_timestep=control_timestep(domain))
    named = name(domain, task)
    return robot_from(adapt_text(named, text, assets, settings), named)


def specification(domain: str, task: str) -> mujoco.MjSpec:
    """Returns the suite's own model of a task, as an editable specification.

    Args:
        domain: One of ``DOMAINS``.
        task: One of its tasks.
    """
    mjcf, assets = _model(domain, task)
    text = mjcf if isinstance(mjcf, bytes) else mjcf.encode()
    document = read_document(text, InMemory(assets))
    with loading_a_model():
        return mujoco.MjSpec.from_string(document.text, assets=dict(document.assets))


def control_timestep(domain: str) -> float | None:
    """Returns the control time step of a domain, s; None if it is the physics time step."""
    found: float | None = getattr(_module(domain), "_CONTROL_TIMESTEP", None)
    return found


def _model(domain: str, task: str) -> tuple[str | bytes, Mapping[str, bytes]]:
    """The MJCF of a task and its assets, from the suite.

    The size of the ground, which depends on the task in the suite, is visual only: planes are
    infinite.
    """
    module = _module(domain)
    if domain == "quadruped":
        return module.make_model(), importlib.import_module("dm_control.suite.common").ASSETS
    size = (_links(task),) if domain == "swimmer" else ()
    found: tuple[str | bytes, Mapping[str, bytes]] = module.get_model_and_assets(*size)
    return found


def _links(task: str) -> int:
    return int(task.removeprefix("swimmer"))


def _swimmer_keyframe(links: int) -> str:
    """A keyframe of a swimmer rotated by a right angle; its ``links - 1`` other joints are at 0."""
    qpos = f"0 0 {math.pi / 2!r}" + " 0" * (links - 1)
    return f'<keyframe><key name="{_FORWARD}" qpos="{qpos}"/></keyframe></mujoco>'


_FORWARD = "forward"


def _module(domain: str) -> Any:  # noqa: ANN401  # modules of dm_control have no types
    # Imported here, because dm_control's physics initialises a display when imported.
    return importlib.import_module(f"dm_control.suite.{domain}")
