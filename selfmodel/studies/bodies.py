"""Bodies of a study, by domain and task, and the failures of each."""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from selfmodel import plugins
from selfmodel.arguments import is_model, robot_entry
from selfmodel.controllers.controller import Design, check_silent_neurons
from selfmodel.errors import InputError, check_name, unknown_name
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import check_cases, notation_kinds
from selfmodel.faults.sensors import silent_neurons
from selfmodel.tasks import ROBOTS, Entry, suite_bodies

DOMAINS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: tuple(entry.suite) for name, entry in ROBOTS.items()}
    | {f"{suite_bodies.PREFIX}{name}": tasks for name, tasks in suite_bodies.DOMAINS.items()}
)
"""Tasks of every domain, the default task first."""

Asked = tuple[int | None, str]
"""A failure that is asked for: the number of a case, or None and a damage in notation."""


def known_cases(bodies: Sequence[str]) -> tuple[int, ...]:
    """Returns the numbers of the cases that apply to at least one body."""
    return tuple(sorted({case for body in bodies for case in robot_entry(body).cases}))


def bodies_of(domains: Sequence[str], tasks: Sequence[str] | None) -> tuple[str, ...]:
    """Returns the unique names of the robots of domains and tasks.

    Args:
        domains: Names in ``DOMAINS``, or paths of MJCF or URDF files. The prefix of a domain of the
            suite may be omitted unless another robot has the same name.
        tasks: Names of tasks; a domain contributes the tasks that it has. None for the default
            task of each domain.
    """
    bodies: list[str] = []
    for given in domains:
        domain = given if is_model(given) else _domain(given)
        every = DOMAINS.get(domain, ())
        chosen = every[:1] if tasks is None else [task for task in every if task in tasks]
        if every and not chosen:
            raise InputError(
                f"{domain} has none of the tasks {', '.join(tasks or ())}: it has "
                f"{', '.join(every)}"
            )
        is_body = domain in ROBOTS or not every
        bodies += [domain] if is_body else [f"{domain}-{task}" for task in chosen]
    known = tasks_of(domains)
    for task in tasks or ():
        check_name("task of these domains", task, known)
    return tuple(dict.fromkeys(bodies))


def tasks_of(domains: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of the tasks of domains; see ``bodies_of``."""
    every = [DOMAINS[_domain(given)] for given in domains if not is_model(given)]
    return tuple(sorted({task for tasks in every for task in tasks}))


def _domain(given: str) -> str:
    domain = given if given in DOMAINS else f"{suite_bodies.PREFIX}{given}"
    if domain not in DOMAINS:
        raise unknown_name("domain", given, DOMAINS)
    return domain


def failures_of(
    robot: str, entry: Entry, cases: Sequence[int] | None, damages: Sequence[str], kinds: str
) -> list[tuple[int | None, str]]:
    """Returns the failures of a robot: the number in Table I, or None, and the notation."""
    searched, anatomy = plugins.kinds(kinds), entry.robot().anatomy
    HypothesisSpace.of(searched, anatomy)  # refuses kinds of which none applies
    check_cases(cases or (), robot, entry.cases)
    numbered = [(case, entry.cases[case]) for case in (entry.cases if cases is None else cases)]
    named = [str(parse(damage, anatomy, notation_kinds(searched))) for damage in damages]
    return [*numbered, *((None, damage) for damage in dict.fromkeys(named))]


def judged(
    robot: str, entry: Entry, design: Design, asked: Iterable[Asked], kinds: str
) -> list[tuple[int | None, str, str]]:
    """Returns failures as ``failures_of`` does, each with the reason why it cannot be, or ""."""
    judged: list[tuple[int | None, str, str]] = []
    for case, damage in asked:
        cases, damages = ((), (damage,)) if case is None else ((case,), ())
        try:
            ((_, truth),) = failures_of(robot, entry, cases, damages, kinds)
            check_silent_neurons(design, silent_neurons(parse(truth, entry.robot().anatomy)))
            judged.append((case, truth, ""))
        except InputError as error:
            judged.append((case, damage, str(error)))
    return judged
