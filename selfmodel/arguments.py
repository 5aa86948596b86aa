"""Arguments by name, notation or path: robots, trials, controllers, hypotheses, repertoires."""

import os
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from selfmodel import plugins
from selfmodel.comparators import PREFERENCE
from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import ComparatorChoice, best_comparator, given_comparator
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.errors import InputError
from selfmodel.faults import KINDS, FaultKind
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.files import encodable, file_digest, read_file
from selfmodel.logs import LogError, TrialLog, load_controller, read_log
from selfmodel.logs.repertoires import check_model, load_repertoire
from selfmodel.logs.robots import common_robot, describe_difference
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.mjcf.load import adapt, check_compiles, load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from selfmodel.robot.mjcf.untrusted import MAX_TEXT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.tasks import Entry, entry
from selfmodel.trials.trial import Trial

AUTO = "auto"
"""Name of the choice of the best comparator that all trials allow."""

RobotSource = Robot | str | Path
"""A robot, its name, or the path of its MJCF or URDF file."""

TrialSource = Trial | str | Path
"""A trial, or the path of its log."""

KindSource = str | Sequence[str | FaultKind]
"""Names of fault kinds separated by commas, or a sequence of names and fault kinds."""

_MODEL_ENDINGS = (".xml", ".urdf", ".xacro")
"""Endings of models; a xacro is refused with the remedy."""


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
    logs = iter(read_logs(paths))
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


def fitted(robot: Robot, trials: Sequence[Trial], threads: int) -> Calibration:
    """Returns a self-model fitted to healthy trials, for callers that calibrate by default.

    Raises:
        InputError: The fit failed; the message names the option that omits calibration.
    """
    try:
        return calibrate(robot, trials, threads)
    except InputError as error:
        raise InputError(
            f"{error}, or leave the calibration out (--no-calibrate, calibrate=False)"
        ) from error


def robot_entry(name: str, settings: Iterable[str] = ()) -> Entry:
    """Returns a robot, its cases and its tasks, by name or by MJCF or URDF file.

    Args:
        name: Name of a robot of selfmodel, or the path of an MJCF or URDF file.
        settings: Settings of the file, such as ``forward=-x``; they override those of the
            TOML file beside it.

    Raises:
        InputError: The name is unknown (the message has the nearest names), the file is no valid
            robot, or settings are given for a robot by name.
    """
    given = tuple(settings)
    if is_model(name):
        made = load_mjcf(Path(name), _settings(name, given))
        return Entry(robot=lambda: made)
    if given:
        raise InputError(
            f"--set {given[0]} is for an MJCF or URDF file: {name!r} is the name of a robot"
        )
    # dm_control would load an OpenGL library.
    os.environ.setdefault("MUJOCO_GL", "disable")
    return entry(name)


def notes_on(name: str, settings: Iterable[str]) -> tuple[str, ...]:
    """Returns the changes that made an MJCF or URDF file a robot; see ``robot_entry``."""
    return adapt(Path(name), _settings(name, settings)).notes


def _settings(name: str, given: Iterable[str]) -> MjcfSettings:
    extra = {key: value for text in given for key, value in parse_setting(text).items()}
    return read_settings(Path(name), extra)


def is_model(name: str) -> bool:
    """Returns whether a robot's name is the path of an MJCF or URDF file."""
    return Path(name).suffix.lower() in _MODEL_ENDINGS


def recorded_robot(name: str, control_timestep: float | None) -> Robot:
    """Returns the robot of a recording: by name, or of a model file, adapted as for a trial.

    A model that a calibration wrote is a robot already, and is not adapted.

    Args:
        name: Name of a robot of selfmodel, or the path of a model file.
        control_timestep: Duration of a control step of a model file, s; None for that of its
            settings.

    Raises:
        InputError: The name is unknown, or the model is unusable.
    """
    if not is_model(name):
        return robot_entry(name).robot()
    path = Path(name)
    if control_timestep is not None and path.suffix.lower() == ".xml":
        try:
            raw = unadapted_robot(name, control_timestep)
        except InputError:
            raw = None
        if raw is not None and raw.is_calibrated:
            return raw
    step = {} if control_timestep is None else {"control_timestep": control_timestep}
    return load_mjcf(path, read_settings(path, step))


def unadapted_robot(name: str, control_timestep: float) -> Robot:
    """Returns a robot by name, or the robot of an unadapted MJCF file.

    Args:
        name: Name of a robot of selfmodel, or a path that ends in ``.xml``.
        control_timestep: Duration of a control step of an MJCF file, s.

    Raises:
        InputError: The name is unknown, or the model is unusable.
    """
    path = Path(name)
    if not is_model(name):
        return robot_entry(name).robot()
    if path.suffix.lower() != ".xml":
        raise InputError(f"{path}: expected an MJCF file, ROBOT.xml, that needs no adaptation")
    data = read_file(path, "an MJCF file", MAX_TEXT)
    try:
        check_compiles(data.decode(), {}, control_timestep)
        return Robot(encodable(path.stem), data.decode(), control_timestep)
    except (ValueError, KeyError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"{path}: expected an MJCF file of a robot without other files: {reason}"
        ) from error


def read_logs(paths: Sequence[Path]) -> list[TrialLog]:
    """Returns the trials in log files.

    Args:
        paths: The logs.

    Raises:
        InputError: A log is unusable, or is given twice.
    """
    try:
        found = [read_log(path) for path in paths]
    except LogError as error:
        raise InputError(str(error)) from error
    digests: dict[str, Path] = {}
    for path in paths:
        first = digests.setdefault(file_digest(path), path)
        if first is not path:
            raise InputError(f"{first} and {path} are the same log: give each log once")
    return found


def robot_of_logs(found: Sequence[TrialLog], override: str | None) -> Robot:
    """Returns the robot of logs.

    Args:
        found: At least one log.
        override: Name of a robot, or an MJCF or URDF file, that replaces the model in the logs.

    Raises:
        InputError: The logs have different robots, their model is unusable, or the replacement has
            other sensors, motors or hinges.
    """
    try:
        own = common_robot(found)
    except LogError as error:
        raise InputError(str(error)) from error
    if override is None:
        return own
    chosen = _override(override, own)
    if chosen.anatomy.names != own.anatomy.names:
        raise InputError(
            f"{override} is another robot than that of {found[0].trial.path}: "
            f"{describe_difference(chosen.anatomy.names, own.anatomy.names)}"
        )
    return chosen


def _override(name: str, own: Robot) -> Robot:
    """Returns the robot that replaces the model in a log; a file is adapted or unchanged."""
    if not is_model(name):
        return robot_entry(name).robot()
    try:
        raw = unadapted_robot(name, own.control_timestep)
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


def read_controller(path: Path, robot: Robot, neurons: int | None = None) -> Controller:
    """Returns the controller in a ``.npz`` file or in a trial's log.

    Args:
        path: The file.
        robot: The robot that the controller must fit.
        neurons: Number of hidden neurons that the controller must have; any if not given.

    Raises:
        InputError: The file contains no controller, or one that does not fit.
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
            f"{path} has recorded commands and no controller: give the log of a trial that "
            f"selfmodel ran, or a .npz file"
        )
    found = loaded.design
    hidden = (found.hidden or None) if neurons is None else neurons
    needed = DESIGNS[found.name](robot, hidden)
    if _connections(found) != _connections(needed):
        raise InputError(
            f"{path} has a controller for {_connections(found)}; this robot needs one for "
            f"{_connections(needed)}: give a controller of this robot"
        )
    return loaded


def _connections(design: Design) -> str:
    return (
        f"the sensors {', '.join(design.sensors)} and the motors {', '.join(design.motors)}, "
        f"{design.description}"
    )
