"""The robots and their dm_control tasks, by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from selfmodel.errors import unknown_name
from selfmodel.robot import Robot
from selfmodel.tasks import hexapod, quadruped

if TYPE_CHECKING:
    from dm_control.rl import control


@dataclass(frozen=True)
class Entry:
    """A robot that comes with selfmodel.

    Attributes:
        robot: Makes it, with nothing wrong.
        cases: The failures of Table I of the paper, by number, in notation.
        suite: Its tasks, as dm_control's suite keeps them.
    """

    robot: Callable[[], Robot]
    cases: Mapping[int, str]
    suite: Mapping[str, Callable[..., "control.Environment"]]


ROBOTS: Mapping[str, Entry] = {
    "quadruped": Entry(quadruped.robot, quadruped.CASES, quadruped.SUITE),
    "hexapod": Entry(hexapod.robot, hexapod.CASES, hexapod.SUITE),
}
"""Every robot that comes with selfmodel."""

ALL_TASKS: tuple[tuple[str, str], ...] = tuple(
    (domain, task) for domain, entry in ROBOTS.items() for task in entry.suite
)
"""Every ``(domain, task)`` that ``load`` knows."""


def load(
    domain_name: str,
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> "control.Environment":
    """Returns a dm_control environment, as ``dm_control.suite.load`` does for its own.

    Args:
        domain_name: A robot, such as ``"quadruped"``.
        task_name: A task of it, such as ``"walk"``.
        task_kwargs: For the task: ``hypothesis``, what is wrong with the robot, in notation;
            ``time_limit`` in seconds; ``random``, a seed or a numpy ``RandomState``.
        environment_kwargs: For ``dm_control.rl.control.Environment``.

    Raises:
        InputError: There is no such robot or task, or the hypothesis cannot be read.
    """
    if domain_name not in ROBOTS:
        raise unknown_name("robot", domain_name, ROBOTS)
    suite = ROBOTS[domain_name].suite
    if task_name not in suite:
        raise unknown_name(f"task of {domain_name}", task_name, suite)
    return suite[task_name](**(task_kwargs or {}), environment_kwargs=environment_kwargs)


__all__ = ["ALL_TASKS", "ROBOTS", "Entry", "load"]
