"""Which bodies a study is of: domains and tasks of the suite, our robots, and anybody's MJCF."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from selfmodel.errors import InputError, unknown_name
from selfmodel.experiments.robots import is_model
from selfmodel.tasks import ROBOTS, suite_bodies

DOMAINS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: tuple(entry.suite) for name, entry in ROBOTS.items()}
    | {f"{suite_bodies.PREFIX}{name}": tasks for name, tasks in suite_bodies.DOMAINS.items()}
)
"""Every domain with its tasks, the one that counts first where none is named."""


def bodies(domains: Sequence[str], tasks: Sequence[str] | None) -> tuple[str, ...]:
    """Returns the names of the robots of some domains and tasks, each once.

    Args:
        domains: Of ``DOMAINS``, those of the suite also without their prefix where we have no
            robot of that name; or paths of MJCF files.
        tasks: Of each domain those of them that it has; None for its first.

    Raises:
        InputError: There is no such domain, it has none of the tasks, or no domain has one of them.
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
    """Returns the names of the tasks of some domains; see ``bodies``."""
    own = [DOMAINS[_domain(given)] for given in domains if not is_model(given)]
    return tuple(sorted({task for tasks in own for task in tasks}))


def _domain(given: str) -> str:
    domain = given if given in DOMAINS else f"{suite_bodies.PREFIX}{given}"
    if domain not in DOMAINS:
        raise unknown_name("domain", given, DOMAINS)
    return domain
