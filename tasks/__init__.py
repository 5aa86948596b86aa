"""The robots and their dm_control tasks, by name."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.tasks import hexapod, quadruped, suite_bodies
from selfmodel.tasks.entry import Entry
from selfmodel.tasks.walking_return import WALKING_RETURN

if TYPE_CHECKING:
    from dm_control.rl import control


ROBOTS: Mapping[str, Entry] = {
    name: Entry(module.robot, module.CASES, module.SUITE, episode_return=WALKING_RETURN)
    for name, module in (("quadruped", quadruped), ("hexapod", hexapod))
}
"""Every robot that comes with selfmodel."""

SUITE: Mapping[str, Mapping[str, Callable[..., "control.Environment"]]] = {
    domain: entry.suite for domain, entry in ROBOTS.items()
}
"""The tasks of every domain; each is what ``SUITE`` is in a domain of dm_control's suite."""

ALL_TASKS: tuple[tuple[str, str], ...] = tuple(
    (domain, task) for domain, tasks in SUITE.items() for task in tasks
)
"""Every ``(domain, task)`` that ``load`` knows."""

TASKS_BY_DOMAIN: Mapping[str, tuple[str, ...]] = {
    domain: tuple(tasks) for domain, tasks in SUITE.items()
}
"""The names of the tasks of every domain."""


def entry(name: str) -> Entry:
    """Returns what is known of a robot: one of ``ROBOTS``, or a body of dm_control's suite.

    Raises:
        InputError: There is none of that name; the message names the nearest.
    """
    if name in ROBOTS:
        return ROBOTS[name]
    if name.removeprefix(suite_bodies.PREFIX).partition("-")[0] in suite_bodies.DOMAINS:
        return suite_bodies.entry(*suite_bodies.parse_name(name))
    raise unknown_name("robot", name, (*ROBOTS, "suite-DOMAIN-TASK"))


def load(
    domain_name: str,
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    visualize_reward: bool = False,  # noqa: FBT001, FBT002  # dm_control's signature
) -> "control.Environment":
    """Returns a dm_control environment, as ``dm_control.suite.load`` does for its own.

    Args:
        domain_name: A robot, such as ``"quadruped"``.
        task_name: A task of it, such as ``"walk"``.
        task_kwargs: For the task: ``hypothesis``, what is wrong with the robot, in notation or as
            a ``Hypothesis``, which may be of kinds of one's own; ``time_limit`` in seconds;
            ``random``, a seed or a numpy ``RandomState``.
        environment_kwargs: For ``dm_control.rl.control.Environment``.
        visualize_reward: Has to be ``False``: these rewards are speeds, and have no colours.

    Raises:
        InputError: There is no such robot or task, the hypothesis cannot be read, or the reward is
            to be shown.
    """
    if domain_name not in SUITE:
        raise unknown_name("robot", domain_name, SUITE)
    if task_name not in SUITE[domain_name]:
        raise unknown_name(f"task of {domain_name}", task_name, SUITE[domain_name])
    if visualize_reward:
        raise InputError(
            f"{domain_name} {task_name}: the reward is a speed and has no colours to be shown in: "
            f"leave visualize_reward at False"
        )
    return SUITE[domain_name][task_name](
        **(task_kwargs or {}), environment_kwargs=environment_kwargs
    )


__all__ = ["ALL_TASKS", "ROBOTS", "SUITE", "TASKS_BY_DOMAIN", "Entry", "entry", "load"]
