"""The registry of robots and of their dm_control tasks, by name."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selfmodel.errors import InputError, check_name, unknown_name
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.tasks import suite_bodies, suite_tasks
from selfmodel.tasks.arguments import check_names
from selfmodel.tasks.entry import Entry, paper_robot

if TYPE_CHECKING:
    from dm_control.rl import control


ROBOTS: Mapping[str, Entry] = {name: paper_robot(name) for name in ("quadruped", "hexapod")}
"""The built-in robots by name."""

SUITE: Mapping[str, Mapping[str, Callable[..., "control.Environment"]]] = {
    **{domain: entry.suite for domain, entry in ROBOTS.items()},
    **{
        f"{suite_bodies.PREFIX}{domain}": {
            task: partial(suite_tasks.environment, domain, task) for task in tasks
        }
        for domain, tasks in suite_tasks.TASKS.items()
    },
}
"""Tasks by domain: of our robots, and of dm_control's suite with the prefix ``suite-``; each value
is the counterpart of ``SUITE`` in a dm_control domain."""

ALL_TASKS: tuple[tuple[str, str], ...] = tuple(
    (domain, task) for domain, tasks in SUITE.items() for task in tasks
)
"""Every ``(domain, task)`` that ``load`` accepts, without those of files."""

TASKS_BY_DOMAIN: Mapping[str, tuple[str, ...]] = {
    domain: tuple(tasks) for domain, tasks in SUITE.items()
}
"""Task names by domain."""


def entry(name: str) -> Entry:
    """Returns the entry of a robot: one of ``ROBOTS``, or a body of dm_control's suite.

    Raises:
        InputError: The name is unknown, with the nearest one in the message, or the body of the
            task cannot be a self-model.
    """
    if name in ROBOTS:
        return ROBOTS[name]
    domain, _, task = name.removeprefix(suite_bodies.PREFIX).partition("-")
    reason = suite_tasks.WITHOUT_SELF_MODEL.get(domain, {}).get(task)
    if reason is not None:
        raise InputError(
            f"{name} is a task, and its body is no robot of selfmodel: {reason}; "
            f"selfmodel.tasks.load({suite_bodies.PREFIX + domain!r}, {task!r}) makes the task"
        )
    bodies = [suite_bodies.name(*body) for body in suite_bodies.BODIES]
    if name in bodies:
        return suite_bodies.entry(domain, task)
    if domain in suite_bodies.DOMAINS or name.startswith(suite_bodies.PREFIX):
        raise unknown_name("robot", name, bodies)
    raise unknown_name("robot", name, (*ROBOTS, "suite-DOMAIN-TASK"))


def load(
    domain_name: str | Path,
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
    visualize_reward: bool = False,  # noqa: FBT001, FBT002  # dm_control's signature
) -> "control.Environment":
    """Returns a dm_control environment, as ``dm_control.suite.load`` does for its own.

    Args:
        domain_name: Name of a robot, such as ``"quadruped"``; of a domain or a body of dm_control's
            suite, such as ``"suite-walker"`` or ``"suite-walker-walk"``; or path of an MJCF or URDF
            file.
        task_name: Name of one of its tasks, such as ``"walk"``.
        task_kwargs: Arguments of the task: ``hypothesis``, the robot's faults, in notation or as a
            ``Hypothesis``, which may have faults of third-party kinds; ``time_limit`` in seconds;
            ``random``, a seed, a numpy ``RandomState`` or a ``Generator``; ``gap``, the level of
            the reality gap; ``start_noise``, the standard deviation of the initial joint angles,
            rad.
        environment_kwargs: Arguments of ``dm_control.rl.control.Environment``.
        visualize_reward: Whether colours show the reward, in tasks of the suite. Must be ``False``
            otherwise: the rewards are speeds, which dm_control cannot map to colours.

    Raises:
        InputError: The robot, the task or an argument of the task is unknown, the file cannot be a
            robot, an argument is out of range, or ``visualize_reward`` is true for a speed.
    """
    check_names(task_kwargs or {})
    make = constructor(domain_name, task_name)
    is_suite = str(domain_name).startswith(suite_bodies.PREFIX)
    if visualize_reward and not is_suite:
        raise InputError(
            f"{domain_name} {task_name}: the reward is a speed and has no colours to be shown in: "
            f"leave visualize_reward at False"
        )
    environment = make(**(task_kwargs or {}), environment_kwargs=environment_kwargs)
    if is_suite:
        environment.task.visualize_reward = visualize_reward
    return environment


def constructor(domain_name: str | Path, task_name: str) -> Callable[..., "control.Environment"]:
    """Returns the function that makes the environments of a task; see ``load``.

    Raises:
        InputError: The robot or the task is unknown, or the file cannot be a robot.
    """
    if isinstance(domain_name, Path) or Path(domain_name).suffix:
        check_name(f"task of {domain_name}", task_name, ("walk",))
        # Imported here, because dm_control's physics initialises a display when imported.
        from selfmodel.tasks import walking  # noqa: PLC0415  # see the line above

        return partial(walking.environment, load_mjcf(domain_name))
    domain, _, task = domain_name.rpartition("-")  # of a body, such as suite-walker-walk
    known = SUITE.get(domain_name)
    if known is None and task in SUITE.get(domain, ()):
        known = {task: SUITE[domain][task]}
    if known is None:
        raise unknown_name("robot", domain_name, (*SUITE, "a path that ends in .xml"))
    check_name(f"task of {domain_name}", task_name, known)
    return known[task_name]


__all__ = [
    "ALL_TASKS",
    "ROBOTS",
    "SUITE",
    "TASKS_BY_DOMAIN",
    "Entry",
    "constructor",
    "entry",
    "load",
]
