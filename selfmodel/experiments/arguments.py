"""Arguments of the public functions: objects from names, notation and paths."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from selfmodel.comparators import PREFERENCE
from selfmodel.controllers.controller import Design
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.comparator_choice import (
    ComparatorChoice,
    best_comparator,
    given_comparator,
)
from selfmodel.errors import InputError
from selfmodel.experiments import plugins, trial_logs
from selfmodel.experiments.robots import is_model, robot_entry
from selfmodel.faults import KINDS, FaultKind
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs.repertoires import check_model, load_repertoire
from selfmodel.recovery.repertoire.repertoire import Repertoire
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import Trial

AUTO = "auto"
"""Name of the choice of the best comparator that all trials allow."""

RobotSource = Robot | str | Path
"""A robot, its name, or the path of its MJCF or URDF file."""

TrialSource = Trial | str | Path
"""A trial, or the path of its log."""

KindSource = str | Sequence[str | FaultKind]
"""Names of fault kinds separated by commas, or a sequence of names and fault kinds."""


def load_robot(name: str | Path, settings: MjcfSettings | None = None) -> Robot:
    """Returns a robot by name, or the robot of an MJCF or URDF file.

    Example:
        >>> import selfmodel
        >>> selfmodel.load_robot("quadruped").anatomy.joint("front_left_knee").hinges
        ('front_left_knee',)

    Args:
        name: ``quadruped``, ``hexapod``, ``suite-DOMAIN-TASK``, or the path of an MJCF or URDF
            file.
        settings: Settings of the file; None for those of the TOML file beside it.

    Raises:
        InputError: The name is unknown, the file is no valid robot, or settings are given for a
            robot by name.
    """
    if is_model(str(name)):
        return load_mjcf(name, settings)
    if settings is not None:
        raise InputError(
            f"settings are for an MJCF or URDF file: {str(name)!r} is the name of a robot"
        )
    return robot_entry(str(name)).robot()


def parse_hypothesis(
    text: str, robot: RobotSource, kinds: Sequence[FaultKind] = tuple(KINDS.values())
) -> Hypothesis:
    """Returns the hypothesis of a text in notation.

    Example:
        >>> import selfmodel
        >>> print(selfmodel.parse_hypothesis("friction=0.4+break:front_left_knee", "quadruped"))
        break:front_left_knee+friction=0.4

    Args:
        text: Terms ``kind:part``, ``kind:part=severity`` or ``kind=severity`` joined by ``+``, or
            ``intact``.
        robot: The robot whose parts the text names, its name, or the path of its MJCF or URDF file.
        kinds: The fault kinds that the text may name.

    Raises:
        InputError: A term is malformed, or names an unknown kind or part.
    """
    return parse(text, robot_of(robot).anatomy, kinds)


def robot_of(source: RobotSource) -> Robot:
    """Returns a robot, given as itself, by name or by MJCF or URDF file.

    Raises:
        InputError: The name is unknown, the file is no valid robot, or the type is another.
    """
    if isinstance(source, Robot):
        return source
    if not isinstance(source, str | Path):
        raise _unexpected(
            'a Robot, a name such as "quadruped" or the path of an MJCF or URDF file', source
        )
    return load_robot(source)


def hypothesis_of(source: Hypothesis | str, robot: Robot) -> Hypothesis:
    """Returns a hypothesis, given as itself or in notation.

    Raises:
        InputError: The notation is invalid for the robot, or the type is another.
    """
    if isinstance(source, Hypothesis):
        return source
    if not isinstance(source, str):
        raise _unexpected('a Hypothesis or notation such as "break:front_left_knee"', source)
    return parse_hypothesis(source, robot)


def comparator_choice(source: Comparator | str) -> ComparatorChoice:
    """Returns the choice of a comparator, given as itself, by name, or as ``auto``.

    Raises:
        InputError: The name is unknown, or its object is no comparator.
    """
    if not isinstance(source, str):
        return partial(given_comparator, source, PREFERENCE)
    if source == AUTO:
        return partial(best_comparator, PREFERENCE)
    return partial(given_comparator, plugins.comparator(source), PREFERENCE)


def kinds_of(source: KindSource) -> tuple[FaultKind, ...]:
    """Returns distinct fault kinds, given as themselves or by name.

    Raises:
        InputError: There are none, a name is unknown, or an item has another type.
    """
    found: list[FaultKind] = []
    for item in [source] if isinstance(source, str | FaultKind) else source:
        if not isinstance(item, str | FaultKind):
            raise _unexpected("a FaultKind or its name", item)
        found += plugins.kinds(item) if isinstance(item, str) else [item]
    if not found:
        raise InputError('expected at least one fault kind, got none: give kinds="break,jam"')
    return tuple(dict.fromkeys(found))


def sources_of(given: TrialSource | Sequence[TrialSource]) -> tuple[TrialSource, ...]:
    """Returns a sequence of trials and paths, given as such or as one trial or path.

    Raises:
        InputError: An item has another type.
    """
    if isinstance(given, Trial | str | Path):
        return (given,)
    expected = "trials or paths of their logs"
    if not isinstance(given, Sequence):
        raise _unexpected(expected, given)
    for item in given:
        if not isinstance(item, Trial | str | Path):
            raise _unexpected(expected, item)
    return tuple(given)


def trials_of(given: TrialSource | Sequence[TrialSource]) -> tuple[Trial, ...]:
    """Returns trials, given as themselves or as paths of their logs.

    Args:
        given: The trials.

    Raises:
        InputError: A log is unusable or given twice, or an item has another type.
    """
    sources = sources_of(given)
    paths = [Path(one) for one in sources if not isinstance(one, Trial)]
    logs = iter(trial_logs.logs(paths))
    return tuple(one if isinstance(one, Trial) else next(logs).trial for one in sources)


def check_seed(seed: int | None) -> None:
    """Checks a seed; None is valid.

    Raises:
        InputError: The seed is negative.
    """
    if seed is not None and seed < 0:
        raise InputError(f"expected a seed of 0 or above, got {seed}: give one such as seed=0")


def _unexpected(expected: str, got: object) -> InputError:
    remedy = ": give its attribute trial" if hasattr(got, "trial") else ""
    return InputError(f"expected {expected}, got an object of type {type(got).__name__}{remedy}")


def repertoire_of(
    source: Repertoire | str | Path | None, robot: Robot, design: Design
) -> Repertoire | None:
    """Returns a repertoire or that of a file, which is of a robot and a design; None if not given.

    Raises:
        InputError: The file is no repertoire or damaged, or the repertoire is of another model or
            another design.
    """
    if source is None:
        return None
    found = source if isinstance(source, Repertoire) else load_repertoire(Path(source))
    named = "the repertoire" if isinstance(source, Repertoire) else str(source)
    check_model(found, robot, named)
    if found.design != design:
        raise InputError(
            f"{named}: expected gaits of the controllers to evolve, {_described(design)}, got "
            f"{_described(found.design)}: leave the design out, or make a repertoire of it"
        )
    return found


def _described(design: Design) -> str:
    return f"a {design.name} of {design.weights} weights"
