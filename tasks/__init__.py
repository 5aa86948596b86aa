"""The registry of robots and of their dm_control tasks, by name."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.tasks import suite_bodies
from selfmodel.tasks.entry import Entry
from selfmodel.tasks.hexapod import HEXAPOD
from selfmodel.tasks.quadruped import QUADRUPED

if TYPE_CHECKING:
    from dm_control.rl import control


ROBOTS: Mapping[str, Entry] = {"quadruped": QUADRUPED, "hexapod": HEXAPOD}
"""The built-in robots by name."""

SUITE: Mapping[str, Mapping[str, Callable[..., "control.Environment"]]] = {
    domain: entry.suite for domain, entry in ROBOTS.items()
}
"""Tasks by domain; each value is the counterpart of ``SUITE`` in a dm_control domain."""

ALL_TASKS: tuple[tuple[str, str], ...] = tuple(
    (domain, task) for domain, tasks in SUITE.items() for task in tasks
)
"""Every ``(domain, task)`` that ``load`` accepts."""

TASKS_BY_DOMAIN: Mapping[str, tuple[str, ...]] = {
    domain: tuple(tasks) for domain, tasks in SUITE.items()
}
"""Task names by domain."""


def entry(name: str) -> Entry:
    """Returns the entry of a robot: one of ``ROBOTS``, or a body of dm_control's suite.

    Raises:
        InputError: The name is unknown; the message contains the nearest one.
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
        domain_name: Name of a robot, such as ``"quadruped"``.
        task_name: Name of one of its tasks, such as ``"walk"``.
        task_kwargs: Arguments of the task: ``hypothesis``, the robot's faults, in notation or as a
            ``Hypothesis``, which may have faults of third-party kinds; ``time_limit`` in seconds;
            ``random``, a seed or a numpy ``RandomState``.
        environment_kwargs: Arguments of ``dm_control.rl.control.Environment``.
        visualize_reward: Must be ``False``: the rewards are speeds, which dm_control cannot map to
            colours.

    Raises:
        InputError: The robot or the task is unknown, the hypothesis cannot be parsed, or
            ``visualize_reward`` is true.
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
