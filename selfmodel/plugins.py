"""Objects by name: comparators, fault kinds, designs and scores, built in or from plug-ins.

A plug-in is an entry point of an installed package, or ``package.module:object``.
"""

import importlib
import sys
from collections.abc import Collection, Iterable, Mapping
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType

from selfmodel.comparators import COMPARATORS
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.diagnosis.comparator import Comparator, as_comparator
from selfmodel.errors import InputError, check_type, items_of, unknown_name
from selfmodel.evolution import Evolution
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS, KIND_SETS, KINDS, kind_names
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.next_trial import by_disagreement
from selfmodel.recovery.recover import NextTrial, by_repair
from selfmodel.recovery.repair import (
    LAYER_CONDITIONS,
    LAYER_COST,
    MakeRepair,
    MakeSearch,
    RepairSearch,
    RobustRepair,
    around_identity,
    from_repertoire,
    layered,
)
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.scores import (
    DISPLACEMENT,
    SCORES,
    TRACKING,
    UPRIGHT,
    VELOCITY,
    Score,
    checked,
)
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.tasks import Entry

NEXT_TRIAL: Mapping[str, NextTrial] = MappingProxyType(
    {"repair": by_repair, "disagreement": by_disagreement}
)
"""Choices of the next trial of a recovery, by name."""

ROBUST, PAPER, COMPENSATE = "robust", "paper", "compensate"
"""Names of the repairs: on rollouts under random conditions, in one exact simulation, and of a
layer around a known controller on rollouts under random conditions."""

DEFAULT_SCORES: Mapping[str, str] = MappingProxyType(
    {ROBUST: UPRIGHT.name, COMPENSATE: UPRIGHT.name, PAPER: DISPLACEMENT.name}
)
"""Name of the score of each repair, unless another is given."""

SEARCHES: Mapping[str, MakeSearch] = MappingProxyType(
    {"cma-es": CmaEs, "ea": partial(Evolution, draw=draw_genomes, noisy=True)}
)
"""Searches of the robust repair that need nothing else, by name."""

REPERTOIRE = "repertoire"
"""Name of the search that begins from a repertoire."""

RETURN = "return"
"""Name of the score that is the sum of a task's rewards."""


def comparator(name: str) -> Comparator:
    """Returns a comparator by name.

    Args:
        name: Name of a comparator of selfmodel, name of an entry point in the group
            ``selfmodel.comparators``, or ``package.module:object``.

    Raises:
        InputError: The name is unknown, or the object is no comparator.
    """
    if name in COMPARATORS:
        return COMPARATORS[name]
    return as_comparator(_plug_in("comparator", name, "selfmodel.comparators", COMPARATORS), name)


def _name_of(what: str, found: object, home: str, known: Mapping[str, object]) -> str:
    """Returns the name by which another process finds an object.

    Raises:
        InputError: It is none of the known objects by name, nor a variable of the module ``home``.
    """
    if isinstance(found, str):
        return found
    names = [name for name, one in known.items() if one is found]
    if home in sys.modules and home != "__main__":
        own = vars(sys.modules[home]).items()
        names += [f"{home}:{name}" for name, one in own if one is found]
    if not names:
        raise InputError(
            f"expected a {what} that other processes find by name, got the object {found!r:.200}, "
            f"which is no variable of the module {home or 'that defines it'}: give "
            f"package.module:object, a variable of a file that can be imported"
        )
    return names[0]


def comparator_names(source: object) -> tuple[str, ...]:
    """Returns the names of comparators, given as one or in a sequence, as names or as themselves.

    Raises:
        InputError: An item is no comparator, or other processes do not find it by name.
    """
    names = []
    for one in items_of(source):
        found = one if isinstance(one, str) else as_comparator(one)
        names.append(_name_of("comparator", found, type(one).__module__, COMPARATORS))
    return tuple(names)


def kinds_named(source: object) -> str:
    """Returns the names of fault kinds, separated by commas; see ``comparator_names``."""
    known = {kind.name: kind for kind in ALL_KINDS}
    names = []
    for one in items_of(source):
        check_type(one, str | FaultKind, "a FaultKind or its name")
        names.append(_name_of("kind", one, type(one).__module__, known))
    return ",".join(names)


def score_named(source: Score | str | None) -> str | None:
    """Returns the name of a score; see ``comparator_names``."""
    check_type(source, Score | str | None, 'a Score or its name, such as "energy"')
    if not isinstance(source, Score):
        return source
    return _name_of("score", source, getattr(source.of, "__module__", ""), SCORES)


def check_known(what: str, name: str, known: Collection[str]) -> None:
    """Raises ``InputError`` with the nearest names for a name that is unknown."""
    if not isinstance(name, str) or name not in known:
        raise unknown_name(what, name, known)


def repair(
    name: str = ROBUST, search: str | None = None, repertoire: Repertoire | None = None
) -> MakeRepair:
    """Returns a function that makes a repair.

    Args:
        name: ``robust``, ``paper`` or ``compensate``.
        search: Name of one of ``SEARCHES``, or ``repertoire``; None as for ``search_name``.
        repertoire: Gaits from which the search ``repertoire`` begins.

    Raises:
        InputError: A name is unknown, another repair than the robust one is to have another search,
            a repertoire is given without the search that needs it, or that without a repertoire.
    """
    check_known("repair", name, DEFAULT_SCORES)
    chosen = search_name(name, search, repertoire)
    check_known("search", chosen, (*SEARCHES, REPERTOIRE))
    if (chosen == REPERTOIRE) != (repertoire is not None):
        raise InputError(
            f"expected a repertoire with the search {REPERTOIRE}, and with no other; got the "
            f"search {chosen} {'with' if repertoire is not None else 'without'} a repertoire: "
            f"give --search {REPERTOIRE} --repertoire FILE, in Python repertoire=, or neither"
        )
    if name == PAPER:
        if chosen != "ea":
            raise InputError(
                f"the paper's repair has its own EA, got the search {chosen}: leave search and "
                f"repertoire out, or give the repair {ROBUST}"
            )
        return RepairSearch
    if name == COMPENSATE:
        if chosen != "cma-es":
            raise InputError(
                f"the repair {COMPENSATE} has CMA-ES from the known controller, got the search "
                f"{chosen}: leave search and repertoire out, or give the repair {ROBUST}"
            )
        return partial(
            RobustRepair,
            make_search=around_identity,
            conditions=LAYER_CONDITIONS,
            cost=LAYER_COST,
        )
    make_search = SEARCHES[chosen] if repertoire is None else from_repertoire(repertoire)
    return partial(RobustRepair, make_search=make_search)


def repaired_around(
    repair: str | None, design: Design, gait: Controller | None
) -> tuple[str, Design, Controller | None]:
    """Returns the name of a repair, the design that it evolves, and the controller it begins from.

    Args:
        repair: Name of the repair; None for ``compensate`` with a known controller, or ``robust``.
        design: Design of the controllers to evolve without a layer.
        gait: Known controller of the robot; None to evolve the first one.

    Raises:
        InputError: A layer is to be evolved around no controller, or a policy without a layer.
    """
    name = repair or (ROBUST if gait is None else COMPENSATE)
    check_known("repair", name, DEFAULT_SCORES)
    if name != COMPENSATE:
        if not design.weights:
            raise InputError(
                f"the repair {name} evolves the weights of a controller, got "
                f"{design.description}: leave the repair out, for a layer around it"
            )
        return name, design, gait
    if gait is None:
        raise InputError(
            f"the repair {name} needs a controller that walks, got the design {design.name}: give "
            f"--controller FILE, a policy file, a .npz or a log; in Python gait="
        )
    inner = layered(gait)
    return name, inner.design, inner


def search_name(repair: str, search: str | None, repertoire: Repertoire | None) -> str:
    """Returns the name of a repair's search: as given, of the repertoire, CMA-ES or the EA."""
    if search is not None:
        return search
    if repertoire is not None:
        return REPERTOIRE
    return "ea" if repair == PAPER else "cma-es"


def kinds(names: str) -> tuple[FaultKind, ...]:
    """Returns fault kinds by name.

    Args:
        names: Names separated by commas: of fault kinds of selfmodel, of their sets in
            ``KIND_SETS``, of entry points in the group ``selfmodel.fault_kinds``, or
            ``package.module:object``.

    Raises:
        InputError: A name is unknown, an object is no fault kind, or two fault kinds have the same
            name or notation.
    """
    chosen = [_kind(name) for name in kind_names(names).split(",")]
    taken: dict[object, FaultKind] = {}
    for kind in (*KINDS.values(), *chosen):
        for key in (kind.name, (kind.keyword, kind.prefix, kind.bounds is None)):
            if taken.setdefault(key, kind) is not kind:
                raise InputError(
                    f"two fault kinds have the name {kind.name!r}, or {kind.keyword!r} in "
                    f"notation: give yours a unique name and a unique keyword"
                )
    return tuple(dict.fromkeys(chosen))


def next_trial(source: NextTrial | str) -> NextTrial:
    """Returns a choice of the next trial, given as a function or by its name in ``NEXT_TRIAL``."""
    if callable(source):
        return source
    check_known("choice of the next trial", source, NEXT_TRIAL)
    return NEXT_TRIAL[source]


def _kind(name: str) -> FaultKind:
    own = {kind.name: kind for kind in ALL_KINDS}
    if name in own:
        return own[name]
    found = _plug_in("kind", name, "selfmodel.fault_kinds", (*own, *KIND_SETS))
    if not isinstance(found, FaultKind):
        raise InputError(
            f"{name!r} is no kind: expected a selfmodel.faults.FaultKind, got {found!r}"
        )
    return found


def _plug_in(what: str, name: str, group: str, built_in: Iterable[str]) -> object:
    """Returns the object of an entry point of a group, or of ``package.module:object``.

    Raises:
        InputError: The name is unknown (the message has the nearest names), its object cannot be
            imported, or two packages have an entry point of that name.
    """
    installed = entry_points(group=group)
    known = dict.fromkeys([*built_in, *sorted(installed.names)])
    paths = {point.value for point in installed if point.name == name}
    if len(paths) > 1:
        raise InputError(
            f"two installed packages have the {what} {name!r}: {', '.join(sorted(paths))}; give "
            f"one as package.module:object"
        )
    path = paths.pop() if paths else name
    module, colon, attribute = path.partition(":")
    if not colon:
        raise unknown_name(what, name, known)
    # As with ``python -m selfmodel``; an installed command has no current folder in its path.
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, SyntaxError, TypeError, ValueError) as error:
        moved = isinstance(error, ImportError) and (error.name or "").startswith("selfmodel")
        hint = "; it was written for selfmodel 0.1, whose modules have moved: see the changelog"
        raise InputError(
            f"cannot find the {what} {name!r}: {error}{hint if moved else ''}; expected "
            f"package.module:object, importable from here, or one of {', '.join(known)}"
        ) from error


def design(name: str, robot: Robot, neurons: int | None = None) -> Design:
    """Returns a controller design of ``DESIGNS`` for a robot, with a number of hidden neurons.

    Raises:
        InputError: The design is unknown, it cannot have that many hidden neurons, or a motor
            has no command range.
    """
    check_known("kind of controller", name, DESIGNS)
    return DESIGNS[name](robot, neurons)


def score(name: str, robot: str, entry: Entry) -> Score:
    """Returns the fitness of a repair by name.

    Args:
        name: One of ``SCORES``; ``return``, the sum of the rewards of the robot's task; the name of
            an entry point in the group ``selfmodel.scores``, or ``package.module:object``.
        robot: Name of the robot.
        entry: The robot's entry.

    Raises:
        InputError: The name is unknown, the object is no score or names unknown signals, or the
            robot has no task with rewards. The function of a plug-in's score raises it if it
            returns other than one number per run.
    """
    if name in SCORES:
        return SCORES[name]
    if name != RETURN:
        found = _plug_in("score", name, "selfmodel.scores", (*SCORES, RETURN, TRACKING, VELOCITY))
        if not isinstance(found, Score):
            raise InputError(
                f"{name!r} is no score: expected a selfmodel.recovery.Score, got {found!r}"
            )
        return checked(found, name)
    if entry.episode_return is None:
        raise InputError(
            f"{robot} has no task of dm_control, so no rewards: give --score {DISPLACEMENT.name}"
        )
    return entry.episode_return
