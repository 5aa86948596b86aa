"""Bodies of a study: domains and tasks of dm_control's suite, the paper's robots, users' files."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from selfmodel.arguments import is_model
from selfmodel.errors import InputError, unknown_name
from selfmodel.tasks import ROBOTS, suite_bodies

DOMAINS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: tuple(entry.suite) for name, entry in ROBOTS.items()}
    | {f"{suite_bodies.PREFIX}{name}": tasks for name, tasks in suite_bodies.DOMAINS.items()}
)
"""Tasks of every domain, the default task first."""


def bodies(domains: Sequence[str], tasks: Sequence[str] | None) -> tuple[str, ...]:
    """Returns the unique names of the robots of domains and tasks.

    Args:
        domains: Names in ``DOMAINS``, or paths of MJCF or URDF files. The prefix of a domain of the
            suite may be omitted unless another robot has the same name.
        tasks: Names of tasks; a domain contributes the tasks that it has. None for the default
            task of each domain.

    Raises:
        InputError: A domain is unknown or has none of the tasks, or no domain has a task.
    """
    found: list[str] = []
    for given in domains:
        if is_model(given):
            found.append(given)
            continue
        domain = _domain(given)
        every = DOMAINS[domain]
        chosen = every[:1] if tasks is None else [task for task in every if task in tasks]
        if not chosen:
            raise InputError(
                f"{domain} has none of the tasks {', '.join(tasks or ())}: it has "
                f"{', '.join(every)}"
            )
        found += [domain] if domain in ROBOTS else [f"{domain}-{task}" for task in chosen]
    known = tasks_of(domains)
    for task in tasks or ():
        if task not in known:
            raise unknown_name("task of these domains", task, known)
    return tuple(dict.fromkeys(found))


def tasks_of(domains: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of the tasks of domains; see ``bodies``."""
    own = [DOMAINS[_domain(given)] for given in domains if not is_model(given)]
    return tuple(sorted({task for tasks in own for task in tasks}))


def _domain(given: str) -> str:
    domain = given if given in DOMAINS else f"{suite_bodies.PREFIX}{given}"
    if domain not in DOMAINS:
        raise unknown_name("domain", given, DOMAINS)
    return domain
