"""Which bodies a study is of: domains and tasks of the suite, our robots, and anybody's MJCF."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from selfmodel.cli.resolve import is_model
from selfmodel.errors import InputError, unknown_name
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
        InputError: There is no such domain, or it has none of the tasks.
    """
    found: list[str] = []
    for given in domains:
        if is_model(given):
            found.append(given)
            continue
        domain = given if given in DOMAINS else f"{suite_bodies.PREFIX}{given}"
        if domain not in DOMAINS:
            raise unknown_name("domain", given, DOMAINS)
        every = DOMAINS[domain]
        chosen = every[:1] if tasks is None else [task for task in every if task in tasks]
        if not chosen:
            raise InputError(
                f"{domain} has none of the tasks {', '.join(tasks or ())}: it has "
                f"{', '.join(every)}"
            )
        found += [domain] if domain in ROBOTS else [f"{domain}-{task}" for task in chosen]
    return tuple(dict.fromkeys(found))
