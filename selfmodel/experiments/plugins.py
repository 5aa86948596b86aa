"""From the names on the command line to the objects that they stand for."""

import importlib
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

from selfmodel.comparators import COMPARATORS
from selfmodel.controllers.controller import Design
from selfmodel.diagnosis.comparator import Comparator, as_comparator
from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS, KINDS
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.recovery.next_trial import NextTrial, by_disagreement, by_repair
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.tasks import Entry

NEXT_TRIAL: Mapping[str, NextTrial] = MappingProxyType(
    {"repair": by_repair, "disagreement": by_disagreement}
)
"""The ways to choose the next trial of a recovery."""

RETURN = "return"
"""The score that is the sum of a task's rewards."""


def comparator(name: str) -> Comparator:
    """Returns a comparator that comes with selfmodel, or another's ``package.module:object``.

    Raises:
        InputError: There is none of that name, or the object is no comparator.
    """
    if name in COMPARATORS:
        return COMPARATORS[name]
    return as_comparator(_plugged_in("comparator", name, COMPARATORS), name)


def next_trial(name: str) -> str:
    """Returns the name of a way to choose the next trial, checked.

    Raises:
        InputError: There is none; the message names the nearest.
    """
    if name not in NEXT_TRIAL:
        raise unknown_name("way to choose the next trial", name, NEXT_TRIAL)
    return name


def kinds(names: str) -> tuple[FaultKind, ...]:
    """Returns the kinds of fault and of environment that are meant, for a diagnosis or in notation.

    Args:
        names: Those of kinds that come with selfmodel, or another's ``package.module:object``,
            separated by commas; ``all`` stands for all that come with it.

    Raises:
        InputError: There is none of a name, an object is no kind, or notation could not tell two
            kinds apart.
    """
    chosen: list[FaultKind] = []
    for name in (name.strip() for name in names.split(",")):
        chosen += ALL_KINDS if name == "all" else [_kind(name)]
    taken: dict[object, FaultKind] = {}
    for kind in (*KINDS.values(), *chosen):
        for called in (kind.name, (kind.keyword, kind.prefix, kind.severity_bounds is None)):
            if taken.setdefault(called, kind) is not kind:
                raise InputError(
                    f"two of the kinds are called {kind.name!r}, or {kind.keyword!r} in notation: "
                    f"give yours a name and a word of its own"
                )
    return tuple(dict.fromkeys(chosen))


def _kind(name: str) -> FaultKind:
    own = {kind.name: kind for kind in ALL_KINDS}
    if name in own:
        return own[name]
    found = _plugged_in("kind", name, (*own, "all"))
    if not isinstance(found, FaultKind):
        raise InputError(
            f"{name!r} is no kind: expected a selfmodel.faults.FaultKind, got {found!r}"
        )
    return found


def _plugged_in(what: str, name: str, known: Iterable[str]) -> object:
    """The object that ``package.module:object`` names.

    Raises:
        InputError: It names none; the message names the nearest of those that are known.
    """
    module, colon, attribute = name.partition(":")
    if not colon:
        raise unknown_name(what, name, known)
    # As with ``python -m selfmodel``, which an installed command does not do by itself.
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, SyntaxError, TypeError, ValueError) as error:
        raise InputError(
            f"cannot find the {what} {name!r}: {error}; expected package.module:object, "
            f"importable from here, or one of {', '.join(known)}"
        ) from error


def design(name: str, robot: Robot, neurons: int | None = None) -> Design:
    """Returns the controller design of that name for a robot.

    Args:
        name: One of ``DESIGNS``.
        robot: The robot that the design is for.
        neurons: Number of hidden neurons; the design's default if not given.

    Raises:
        InputError: There is no such design, it cannot have that many hidden neurons, or a motor
            has no command range.
    """
    if name not in DESIGNS:
        raise unknown_name("kind of controller", name, DESIGNS)
    return DESIGNS[name](robot, neurons)


def score(name: str, robot: str, entry: Entry) -> Score:
    """Returns the measure of that name of how well a robot does.

    Raises:
        InputError: There is none, or the robot has no task whose rewards could be added up.
    """
    if name == DISPLACEMENT.name:
        return DISPLACEMENT
    if name != RETURN:
        raise unknown_name("score", name, (DISPLACEMENT.name, RETURN))
    if entry.episode_return is None:
        raise InputError(
            f"{robot} has no task of dm_control, so no rewards: leave --score at "
            f"{DISPLACEMENT.name}"
        )
    return entry.episode_return
