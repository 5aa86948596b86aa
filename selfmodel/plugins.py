"""Objects by name: those of selfmodel, and plug-ins, in the ``REGISTRIES``.

A plug-in is an entry point of an installed package, or ``package.module:object``.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import entry_points
from inspect import isfunction, signature
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.comparators import COMPARATORS
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.diagnosis.comparator import Comparator, as_comparator
from selfmodel.errors import InputError, check_name, check_type, items_of, unknown_name
from selfmodel.evolution import Evolution, GenomeSearch
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS, KIND_SETS, KINDS, kind_names
from selfmodel.files import imported
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.next_trial import by_disagreement
from selfmodel.recovery.recover import NextTrial, by_repair
from selfmodel.recovery.repair import (
    MakeRepair,
    MakeSearch,
    RepairSearch,
    RobustRepair,
    from_repertoire,
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
from selfmodel.settings import Settings
from selfmodel.tasks import Entry

MakeDesign = Callable[[Robot, int | None], Design]
"""Function from a robot and a number of hidden neurons, None for the default, to a design."""

NEXT_TRIAL: Mapping[str, NextTrial] = MappingProxyType(
    {"repair": by_repair, "disagreement": by_disagreement}
)
"""Choices of the next trial of a recovery, by name."""

ROBUST, PAPER, COMPENSATE, FINETUNE = "robust", "paper", "compensate", "finetune"
"""Names of the repairs: on rollouts under random conditions; in one exact simulation; and, under
random conditions, of a layer around a known controller, or of the last layer of a policy."""

FILES = {COMPENSATE: "a policy file, a .npz or a log", FINETUNE: "a policy file or a log of one"}
"""Files of the known controller that a repair changes."""

DEFAULT_SCORES: Mapping[str, str] = MappingProxyType(
    {**dict.fromkeys((ROBUST, COMPENSATE, FINETUNE), UPRIGHT.name), PAPER: DISPLACEMENT.name}
)
"""Name of the score of each repair, unless another is given."""


def _strategy(
    length: int, settings: Settings, rng: np.random.Generator, seeds: Sequence[FloatArray] = ()
) -> GenomeSearch:
    from selfmodel.recovery.evolution_strategy import EvolutionStrategy  # noqa: PLC0415  # rare

    return EvolutionStrategy(length, settings, rng, seeds)


SEARCHES: Mapping[str, MakeSearch] = MappingProxyType(
    {
        "cma-es": CmaEs,
        "ea": partial(Evolution, draw=draw_genomes, noisy=True),
        "es": _strategy,
    }
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
    return as_comparator(_found("comparator", name), name)


@dataclass(frozen=True)
class Registry:
    """Objects that the values of a parameter name.

    Attributes:
        what: What one of them is called.
        group: Group of the entry points of installed plug-ins.
        known: Selfmodel's own by name; for a name of no single object, a text of what it needs.
        takes: Arguments of the objects, if they are functions.
    """

    what: str
    group: str
    known: Mapping[str, object]
    takes: tuple[str, ...] = ()


REGISTRIES: Mapping[str, Registry] = MappingProxyType(
    {
        "comparator": Registry("comparator", "selfmodel.comparators", COMPARATORS),
        "kinds": Registry(
            "kind",
            "selfmodel.fault_kinds",
            {
                **{kind.name: kind for kind in ALL_KINDS},
                **dict.fromkeys(KIND_SETS, "is a set of kinds: give one of them"),
            },
        ),
        "score": Registry(
            "score",
            "selfmodel.scores",
            {
                **SCORES,
                RETURN: "is of a robot's task: give the robot",
                TRACKING: "follows a trajectory, which is not given here: give "
                "selfmodel.recovery.tracking(reference, robot), or another score",
                VELOCITY: "follows the velocity that a policy is commanded: give --controller "
                "policy.toml with the term velocity, in Python "
                "selfmodel.recovery.following(velocity), or another score",
            },
        ),
        "next_trial": Registry(
            "choice of the next trial", "selfmodel.next_trials", NEXT_TRIAL, ("loop",)
        ),
        "controller": Registry(
            "kind of controller", "selfmodel.controllers", DESIGNS, ("robot", "hidden")
        ),
        "search": Registry(
            what="search",
            group="selfmodel.searches",
            known={**SEARCHES, REPERTOIRE: "needs gaits: give a repertoire"},
            takes=("length", "settings", "rng", "seeds"),
        ),
    }
)
"""What plug-ins may be, by the name of the parameter that names them."""


def name_of(parameter: str, found: object, home: str = "") -> str:
    """Returns the name by which another process finds an object; a text is a name.

    Of several modules with such a variable, it is that which defines the object's class, or the
    function; or else the innermost, as a package imports from its modules, and the first by name.

    Args:
        parameter: One of ``REGISTRIES``.
        found: The object.
        home: The first module to look into; that of the object's class if not given.

    Raises:
        InputError: It is none of selfmodel's, nor a variable of an imported module.
    """
    registry = REGISTRIES[parameter]
    if isinstance(found, str):
        return found
    names = [name for name, one in registry.known.items() if one is found]
    if names:
        return names[0]
    places = [
        (module != (home or getattr(found, "__module__", "")), -module.count("."), module, name)
        for module, loaded in list(sys.modules.items())
        if module not in ("__main__", "__mp_main__")
        for name, one in list(getattr(loaded, "__dict__", {}).items())
        if one is found and getattr(loaded, "__spec__", None) is not None
    ]
    if not places:
        raise InputError(
            f"expected a {registry.what} that other processes find by name, got the object "
            f"{found!r:.200}, which is no variable of an imported module: write it in a file that "
            f"can be imported, and give it from there, or as package.module:object"
        )
    _, _, module, name = min(places)
    return f"{module}:{name}"


def modules_of(parameters: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the modules of the plug-ins that parameters name, those of ``REGISTRIES``."""
    named = [
        _module_of(parameter, name)
        for parameter in REGISTRIES
        if isinstance(names := parameters.get(parameter), str)
        for name in names.split(",")
    ]
    return tuple(sorted(set(filter(None, named))))


@cache
def _module_of(parameter: str, name: str) -> str:
    """Returns the module of a plug-in; "" for what is none."""
    if name in REGISTRIES[parameter].known:
        return ""
    module, colon, _ = _path_of(REGISTRIES[parameter], name).partition(":")
    return module if colon else ""


def comparator_names(source: object) -> tuple[str, ...]:
    """Returns the names of comparators, given as one or in a sequence, as names or as themselves.

    Raises:
        InputError: An item is no comparator, or other processes do not find it by name.
    """
    if isinstance(source, str) and "," in source:
        names = ", ".join(f'"{name.strip()}"' for name in source.split(","))
        raise InputError(f"expected comparators in a list, got {source!r}: give [{names}]")
    found = (one if isinstance(one, str) else as_comparator(one) for one in items_of(source))
    return tuple(name_of("comparator", one) for one in found)


def kinds_named(source: object) -> str:
    """Returns the names of fault kinds, separated by commas; see ``comparator_names``."""
    if not (found := items_of(source)):
        raise InputError('expected at least one fault kind, got none: give kinds="break,jam"')
    for one in found:
        check_type(one, str | FaultKind, "a FaultKind or its name")
    return ",".join(name_of("kinds", one) for one in found)


def score_named(source: Score | str | None) -> str | None:
    """Returns the name of a score; see ``comparator_names``."""
    check_type(source, Score | str | None, 'a Score or its name, such as "energy"')
    if not isinstance(source, Score):
        return source
    return name_of("score", source, getattr(source.of, "__module__", ""))


def repair(
    name: str = ROBUST,
    search: str | MakeSearch | None = None,
    repertoire: Repertoire | None = None,
) -> MakeRepair:
    """Returns a function that makes a repair.

    Args:
        name: ``robust``, ``paper``, ``compensate`` or ``finetune``.
        search: A ``MakeSearch``, or the name of one: of ``SEARCHES``, ``repertoire``, of an entry
            point in the group ``selfmodel.searches``, or ``package.module:object``; None as for
            ``search_name``.
        repertoire: Gaits from which the search ``repertoire`` begins.

    Raises:
        InputError: A name is unknown, another repair than the robust one is to have another search,
            a repertoire is given without the search that needs it, or that without a repertoire.
    """
    check_name("repair", name, DEFAULT_SCORES)
    chosen = search_name(name, None, repertoire) if search is None else search
    if chosen != REPERTOIRE:
        make_search = _function("search", chosen)
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
    if name in FILES:
        if chosen != "cma-es":
            raise InputError(
                f"the repair {name} has CMA-ES from the known controller, got the search "
                f"{chosen}: leave search and repertoire out, or give the repair {ROBUST}"
            )
        from selfmodel.recovery.layers import LayerRepair  # noqa: PLC0415  # few robots have one

        return LayerRepair
    if repertoire is not None:
        make_search = from_repertoire(repertoire)
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
    check_name("repair", name, DEFAULT_SCORES)
    if name not in FILES:
        if not design.weights:
            raise InputError(
                f"the repair {name} evolves the weights of a controller, got "
                f"{design.description}: leave the repair out, for a layer around it"
            )
        return name, design, gait
    if gait is None:
        raise InputError(
            f"the repair {name} needs a controller that walks, got the design {design.name}: give "
            f"--controller FILE, {FILES[name]}; in Python gait="
        )
    from selfmodel.recovery.layers import finetunable, layered  # noqa: PLC0415  # few robots have one

    gait = finetunable(gait) if name == FINETUNE else layered(gait)
    return name, gait.design, gait


def search_name(repair: str, search: MakeSearch | str | None, repertoire: Repertoire | None) -> str:
    """Returns the name of a repair's search: as given, of the repertoire, CMA-ES or the EA."""
    if search is not None:
        return name_of("search", search)
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


def search(source: MakeSearch | str) -> MakeSearch:
    """Returns a function that makes a search, given as itself or by its name."""
    return _function("search", source)


def next_trial(source: NextTrial | str) -> NextTrial:
    """Returns a choice of the next trial, given as a function or by its name."""
    return _function("next_trial", source)


def _function(parameter: str, source: object) -> Callable[..., Any]:
    """Returns a function, given as itself or by its name.

    Raises:
        InputError: The name is unknown, or its object is no function.
    """
    registry = REGISTRIES[parameter]
    found: object = _found(parameter, source) if isinstance(source, str) else source
    try:
        signature(found).bind(*registry.takes)  # type: ignore[arg-type]  # it raises TypeError
    except (TypeError, ValueError) as error:
        got = f"the function {found.__qualname__}" if isfunction(found) else f"{found!r:.200}"
        policy = '; a policy is given by a file NAME.toml with network = "package.module:function"'
        raise InputError(
            f"{repr(source) if isinstance(source, str) else got} is no {registry.what}: expected a "
            f"function of the arguments {', '.join(registry.takes)}, got {got} ({error})"
            f"{policy if parameter == 'controller' else ''}"
        ) from error
    return cast("Callable[..., Any]", found)


def _kind(name: str) -> FaultKind:
    found = _found("kinds", name)
    if not isinstance(found, FaultKind):
        raise InputError(
            f"{name!r} is no kind: expected a selfmodel.faults.FaultKind, got {found!r}"
        )
    return found


def _found(parameter: str, name: str) -> object:
    """Returns an object of selfmodel's, of an entry point, or of ``package.module:object``.

    Raises:
        InputError: The name is unknown (the message has the nearest names), its object cannot be
            imported, or two packages have an entry point of that name.
    """
    registry = REGISTRIES[parameter]
    own = registry.known.get(name)
    if isinstance(own, str):
        raise InputError(f"the {registry.what} {name} {own}")
    if own is not None:
        return own
    known = dict.fromkeys([*registry.known, *sorted(entry_points(group=registry.group).names)])
    path = _path_of(registry, name)
    if ":" not in path:
        raise unknown_name(registry.what, name, known)
    return imported(path, registry.what, name, f", or one of {', '.join(known)}")


def _path_of(registry: Registry, name: str) -> str:
    """Returns the ``package.module:object`` of an entry point; any other name as it is."""
    installed = entry_points(group=registry.group)
    paths = {point.value for point in installed if point.name == name}
    if len(paths) > 1:
        raise InputError(
            f"two installed packages have the {registry.what} {name!r}: "
            f"{', '.join(sorted(paths))}; give one as package.module:object"
        )
    return paths.pop() if paths else name


def design(name: str | MakeDesign, robot: Robot, neurons: int | None = None) -> Design:
    """Returns a controller design for a robot, with a number of hidden neurons.

    Args:
        name: A function like those of ``DESIGNS``, or the name of one: of these, of an entry point
            in the group ``selfmodel.controllers``, or ``package.module:function``.
        robot: The robot.
        neurons: Number of hidden neurons; None for that of the design.

    Raises:
        InputError: The design is unknown, it cannot have that many hidden neurons, or a motor
            has no command range.
    """
    made = _function("controller", name)(robot, neurons)
    if not isinstance(made, Design):
        raise InputError(
            f"{name!r} is no kind of controller: expected a function that returns a Design, and "
            f"it returned {made!r:.200}"
        )
    return made


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
    if name != RETURN:
        found = _found("score", name)
        if not isinstance(found, Score):
            raise InputError(
                f"{name!r} is no score: expected a selfmodel.recovery.Score, got {found!r}"
            )
        return found if name in SCORES else checked(found, name)
    if entry.episode_return is None:
        raise InputError(
            f"{robot} has no task of dm_control, so no rewards: give --score {DISPLACEMENT.name}"
        )
    return entry.episode_return
