"""From the names on the command line to the objects that they stand for."""

import hashlib
import importlib
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType

from selfmodel.comparators import COMPARATORS
from selfmodel.controllers.driver import Design, Driver, Evolved
from selfmodel.controllers.network import Controller, Network
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.registry import ALL_KINDS, KINDS
from selfmodel.logs import LogError, TrialLog, load_controller, read_log
from selfmodel.logs.files import read_bounded
from selfmodel.logs.robots import described_difference, the_robot_of
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.recovery.next_trial import NextTrial, by_disagreement, by_repair
from selfmodel.robot.mjcf.adaptation import adapt
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from selfmodel.robot.robot import Robot
from selfmodel.robot.robot import with_neurons as neurons_in
from selfmodel.tasks import Entry, entry
from selfmodel.trials.behaviour import Names
from selfmodel.trials.trial import STAGES, Stage, stage_of

DESIGNS: Mapping[str, Callable[[Robot], Design]] = MappingProxyType(
    {"network": attrgetter("network"), "cpg": attrgetter("cpg")}
)
"""The kinds of controller that a repair EA can evolve."""

NEXT_TRIAL: Mapping[str, NextTrial] = MappingProxyType(
    {"repair": by_repair, "disagreement": by_disagreement}
)
"""The ways to choose the next trial of a recovery."""

RETURN = "return"
"""The score that is the sum of a task's rewards."""

LARGEST_MODEL = 64 * 2**20
"""Bytes that an MJCF file may have."""


def robot_entry(name: str, settings: Iterable[str] = ()) -> Entry:
    """Returns the robot of that name, or the one that somebody's MJCF describes.

    Args:
        name: One of those that come with selfmodel, or a path that ends in ``.xml``.
        settings: What the MJCF does not tell, such as ``forward=-x``; they count before those of
            the TOML beside it.

    Raises:
        InputError: There is none, and the message names the nearest; or none can be made of the
            MJCF, or settings are given for a robot that needs none.
    """
    given = tuple(settings)
    if is_model(name):
        made = load_mjcf(Path(name), _settings(name, given))
        return Entry(robot=lambda: made)
    if given:
        raise InputError(f"--set {given[0]} is for a robot's MJCF: {name!r} has all that it needs")
    # Nothing is drawn here, and dm_control would look for what to draw with.
    os.environ.setdefault("MUJOCO_GL", "disable")
    return entry(name)


def notes_on(name: str, settings: Iterable[str]) -> tuple[str, ...]:
    """Returns what was done to an MJCF to make a robot of it; see ``robot_entry``."""
    return adapt(Path(name), _settings(name, settings)).notes


def _settings(name: str, given: Iterable[str]) -> MjcfSettings:
    extra = {key: value for text in given for key, value in parse_setting(text).items()}
    return read_settings(Path(name), extra)


def case_notation(entry: Entry, case: int | None, damage: str | None) -> str:
    """Returns the notation of a failure given by its number in Table I or by itself.

    Raises:
        InputError: Neither or both are given, or there is no case of that number.
    """
    if (case is None) == (damage is None):
        given = "neither" if case is None else "both"
        numbers, example = ", ".join(map(str, entry.cases)), next(iter(entry.cases.values()))
        raise InputError(
            f"expected either --case N or --damage NOTATION, got {given}: cases are {numbers}, a "
            f"notation is like {example}"
        )
    if damage is not None:
        return damage
    if case is None or case not in entry.cases:
        raise unknown_name("case of Table I", str(case), map(str, entry.cases))
    return entry.cases[case]


def comparator(name: str) -> Comparator:
    """Returns a comparator that comes with selfmodel, or another's ``package.module:object``.

    Raises:
        InputError: There is none of that name, or the object is no comparator.
    """
    if name in COMPARATORS:
        return COMPARATORS[name]
    found = _plugged_in("comparator", name, COMPARATORS)
    if isinstance(found, type) or not isinstance(found, Comparator):
        raise InputError(
            f"{name!r} is no comparator: expected an object, not a class, with the members of "
            f"selfmodel.diagnosis.comparator.Comparator, got {found!r}"
        )
    return found


def next_trial(name: str) -> str:
    """Returns the name of a way to choose the next trial, checked.

    Raises:
        InputError: There is none; the message names the nearest.
    """
    if name not in NEXT_TRIAL:
        raise unknown_name("way to choose the next trial", name, NEXT_TRIAL)
    return name


def stage(name: str) -> Stage:
    """Returns where in a story a trial stands.

    Raises:
        InputError: There is no such place; the message names the nearest.
    """
    found = stage_of(name)
    if found is None:
        raise unknown_name("stage", name, STAGES)
    return found


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


def design(name: str, robot: Robot) -> Design:
    """Returns the kind of controller of that name, for a robot.

    Raises:
        InputError: There is no such kind, or a motor does not say what it may be commanded.
    """
    if name not in DESIGNS:
        raise unknown_name("kind of controller", name, DESIGNS)
    return DESIGNS[name](robot)


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


def with_neurons(robot: Robot, neurons: int | None, design: str) -> Robot:
    """Returns the robot with that many hidden neurons, or as it is where none are asked for.

    Raises:
        InputError: They are too many or none, or its controller is to be of a kind without them.
    """
    if neurons is None:
        return robot
    if design != "network":
        raise InputError(f"--neurons {neurons} is of a network: leave it out with {design!r}")
    return neurons_in(robot, neurons)


def check_neurons(truth: Hypothesis, driver: Design | Driver) -> None:
    """Checks that what drives a robot has neurons where one of them is to be silent.

    Raises:
        InputError: It has none.
    """
    if isinstance(driver, Network | Controller):
        return
    for fault in truth.faults:
        if fault.kind is SILENT_NEURON:
            raise InputError(
                f"{fault} means nothing to a robot that oscillators drive, which have no hidden "
                f"neurons: leave it out, or drive the robot with a network"
            )


def controller(path: Path, robot: Robot) -> Evolved:
    """Returns the controller in a ``.npz`` file or in a trial's log.

    Raises:
        InputError: The file cannot be read as either, or its controller fits another robot.
    """
    try:
        loaded = (
            read_log(path).trial.plan.controller
            if path.suffix.lower() == ".mcap"
            else load_controller(path)
        )
    except LogError as error:
        raise InputError(str(error)) from error
    if isinstance(loaded, Playback):
        raise InputError(
            f"{path} has no controller, only the commands that were recorded: give the log of a "
            f"robot that selfmodel drove, or a .npz"
        )
    needed = _described(
        robot.anatomy.names,
        f"with {robot.anatomy.neurons} hidden neurons"
        if isinstance(loaded, Controller)
        else f"every {robot.control_timestep:g} s",
    )
    found = _described(
        loaded.design,
        f"with {loaded.network.hidden} hidden neurons"
        if isinstance(loaded, Controller)
        else f"every {loaded.cpg.timestep:g} s",
    )
    if found != needed:
        raise InputError(
            f"{path} has a controller for {found}; this robot needs one for {needed}: give one "
            f"that was made for it"
        )
    return loaded


def _described(ends: Design | Names, more: str) -> str:
    return f"the sensors {', '.join(ends.sensors)}, the motors {', '.join(ends.motors)}, {more}"


def logs(paths: Sequence[Path]) -> list[TrialLog]:
    """Returns the trials in some logs.

    Raises:
        InputError: One cannot be used, or is given twice.
    """
    try:
        found = [read_log(path) for path in paths]
    except LogError as error:
        raise InputError(str(error)) from error
    digests: dict[bytes, Path] = {}
    for path in paths:
        with path.open("rb") as file:
            first = digests.setdefault(hashlib.file_digest(file, "sha256").digest(), path)
        if first is not path:
            raise InputError(f"{first} and {path} are the same log: give each log once")
    return found


def robot_of_logs(found: Sequence[TrialLog], override: str | None) -> Robot:
    """Returns the robot that logs are of.

    Args:
        found: At least one log.
        override: The name of a robot, or an MJCF file, to take in the place of the logs' model.

    Raises:
        InputError: The logs are of different robots, their model cannot be used, or the other does
            not have their sensors, motors and hinges.
    """
    try:
        own = the_robot_of(found)
    except LogError as error:
        raise InputError(str(error)) from error
    if override is None:
        return own
    chosen = _override(override, own)
    if chosen.anatomy.names != own.anatomy.names:
        raise InputError(
            f"{override} is another robot than that of {found[0].trial.path}: "
            f"{described_difference(chosen.anatomy.names, own.anatomy.names)}"
        )
    return chosen


def _override(name: str, own: Robot) -> Robot:
    """The model to take in the place of a log's: made ready as the log's was, or as it stands."""
    if not is_model(name):
        return robot_entry(name).robot()
    try:
        raw = robot(name, own.control_timestep)
    except InputError:
        raw = None
    if raw is not None and raw.is_calibrated:
        return raw
    path = Path(name)
    settings = read_settings(path, {"control_timestep": own.control_timestep})
    ready = load_mjcf(path, settings)
    names = own.anatomy.names
    if raw is not None and ready.anatomy.names != names == raw.anatomy.names:
        return raw
    return ready


def is_model(name: str) -> bool:
    """Returns whether a robot's name is the path of an MJCF file."""
    return Path(name).suffix.lower() == ".xml"


def robot(name: str, control_timestep: float) -> Robot:
    """Returns the robot of that name, or the one that an MJCF file describes.

    Args:
        name: One that ``selfmodel robots`` lists, or a path that ends in ``.xml``.
        control_timestep: Seconds between two commands, for the MJCF file.

    Raises:
        InputError: There is none, or the model cannot be used.
    """
    path = Path(name)
    if not is_model(name):
        return robot_entry(name).robot()
    data = read_bounded(path, "an MJCF file", LARGEST_MODEL)
    try:
        return Robot(path.stem, data.decode(), control_timestep)
    except (ValueError, KeyError) as error:
        what = " ".join(str(error).split())
        raise InputError(
            f"{path}: expected an MJCF file of a robot that needs no other file: {what}"
        ) from error


def threads(requested: int) -> int:
    """Returns how many threads to use: as many as processors where 0 are requested."""
    return requested or len(os.sched_getaffinity(0))
