"""Arguments by name, notation or path: robots, trials, controllers, hypotheses, repertoires."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from selfmodel import plugins
from selfmodel.comparators import PREFERENCE
from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import ComparatorChoice, chosen_comparator
from selfmodel.diagnosis.comparator import Comparator, as_comparator
from selfmodel.errors import InputError, check_function, check_type, items_of
from selfmodel.faults import KINDS, FaultKind
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.files import encodable, file_digest, path_of, read_file
from selfmodel.logs import LogError, TrialLog, load_controller, read_log
from selfmodel.logs.repertoires import check_model, load_repertoire
from selfmodel.logs.robots import common_robot, describe_difference
from selfmodel.progress import Observer, ignore
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.mjcf.load import check_compiles, load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from selfmodel.robot.mjcf.untrusted import MAX_TEXT
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration, calibrate
from selfmodel.tasks import Entry, entry
from selfmodel.trials.signals import Names
from selfmodel.trials.trial import Trial

AUTO = "auto"
"""Name of the choice of the best comparator that all trials allow."""

RobotSource = Robot | str | Path
"""A robot, its name, or the path of its MJCF or URDF file."""

TrialSource = Trial | str | Path
"""A trial, or the path of its log."""

KindSource = str | FaultKind | Sequence[str | FaultKind]
"""Names of fault kinds separated by commas, a fault kind, or a sequence of names and kinds."""

NOTATION = tuple(KINDS.values())
"""The built-in kinds that a notation may name."""

REPAIR_SETTINGS = "settings of the repair such as selfmodel.RepairSettings(generations=60)"
"""What is expected as settings of the repair."""

_ROBOT = 'a Robot, a name such as "quadruped" or the path of an MJCF or URDF file'

_MODEL_ENDINGS = (".xml", ".urdf", ".xacro")
"""Endings of models; a xacro is refused with the remedy."""


def load_robot(name: RobotSource, settings: MjcfSettings | None = None) -> Robot:
    """Returns a robot by name, or the robot of an MJCF or URDF file.

    Example:
        >>> import selfmodel
        >>> selfmodel.load_robot("quadruped").anatomy.joint("front_left_knee").hinges
        ('front_left_knee',)

    Args:
        name: ``quadruped``, ``hexapod``, ``suite-DOMAIN-TASK``, or the path of an MJCF or URDF
            file; a robot is returned as it is.
        settings: Settings of the file; None for those of the TOML file beside it.

    Raises:
        InputError: The name is unknown, the file is no valid robot, settings are given for a
            robot by name, or the type is another.
    """
    check_type(name, Robot | str | Path, _ROBOT)
    if isinstance(name, str | Path) and is_model(str(name)):
        return load_mjcf(name, settings)
    if settings is not None:
        raise InputError(
            f"settings are for an MJCF or URDF file: {str(name)!r} is the name of a robot"
        )
    return name if isinstance(name, Robot) else robot_entry(str(name)).robot()


def parse_hypothesis(
    text: Hypothesis | str, robot: RobotSource, kinds: KindSource = NOTATION
) -> Hypothesis:
    """Returns the hypothesis of a text in notation.

    Example:
        >>> import selfmodel
        >>> print(selfmodel.parse_hypothesis("friction=0.4+break:front_left_knee", "quadruped"))
        break:front_left_knee+friction=0.4

    Args:
        text: Terms ``kind:part``, ``kind:part=severity`` or ``kind=severity`` joined by ``+``, or
            ``intact``; a hypothesis is returned as it is.
        robot: The robot whose parts the text names, its name, or the path of its MJCF or URDF file.
        kinds: The fault kinds that the text may name, or their names.

    Raises:
        InputError: A term is malformed, or names an unknown kind or part.
    """
    check_type(text, Hypothesis | str, 'a Hypothesis or notation such as "break:front_left_knee"')
    if isinstance(text, Hypothesis):
        return text
    return parse(text, load_robot(robot).anatomy, kinds_of(kinds))


def entry_of(source: RobotSource) -> Entry:
    """Returns the entry of a robot, whose model is loaded once; a ``Robot`` has no task."""
    if isinstance(source, Robot):
        return Entry(lambda: source)
    check_type(source, str | Path, _ROBOT)
    entry = robot_entry(str(source))
    robot = entry.robot()
    return replace(entry, robot=lambda: robot)


def comparator_choice(source: Comparator | str) -> ComparatorChoice:
    """Returns the choice of a comparator, given as itself, by name, or as ``auto``.

    Raises:
        InputError: The name is unknown, or its object is no comparator.
    """
    if isinstance(source, str) and source == AUTO:
        return partial(chosen_comparator, PREFERENCE)
    return partial(chosen_comparator, PREFERENCE, given=comparator_of(source))


def comparator_of(source: Comparator | str) -> Comparator:
    """Returns a comparator, given as itself or by name; see ``plugins.comparator``."""
    if isinstance(source, str):
        return plugins.comparator(source)
    return as_comparator(source)


def kinds_of(source: KindSource) -> tuple[FaultKind, ...]:
    """Returns distinct fault kinds, given as themselves or by name.

    Raises:
        InputError: There are none, a name is unknown, or an item has another type.
    """
    found: list[FaultKind] = []
    for item in items_of(source):
        check_type(item, str | FaultKind, "a FaultKind or its name")
        found += [item] if isinstance(item, FaultKind) else plugins.kinds(str(item))
    if not found:
        raise InputError('expected at least one fault kind, got none: give kinds="break,jam"')
    return tuple(dict.fromkeys(found))


def trials_of(
    *groups: TrialSource | Sequence[TrialSource],
) -> tuple[list[tuple[Trial, ...]], list[TrialLog]]:
    """Returns groups of trials, given as themselves or as paths of their logs, and these logs.

    Raises:
        InputError: A log is unusable or given twice, or an item has another type.
    """
    expected = "trials or paths of their logs"
    listed: list[Sequence[TrialSource]] = [
        (group,) if isinstance(group, Trial | str | Path) else group for group in groups
    ]
    for sources in listed:
        check_type(sources, Sequence, expected)
        for source in sources:
            check_type(source, Trial | str | Path, expected)
    logs = read_logs([Path(s) for sources in listed for s in sources if not isinstance(s, Trial)])
    read = iter(logs)
    found = [
        tuple(s if isinstance(s, Trial) else next(read).trial for s in sources)
        for sources in listed
    ]
    return found, logs


def trial_of(source: TrialSource | Sequence[TrialSource]) -> Trial:
    """Returns one trial, given as itself or as the path of its log, or in a sequence of one."""
    (found,), _ = trials_of(source)
    if len(found) != 1:
        raise InputError(f"expected one trial or the path of its log, got {len(found)}: give one")
    return found[0]


def settings_of(settings: Settings | None) -> Settings:
    """Returns settings, the paper's for None, or raises ``InputError``."""
    check_type(settings, Settings | None, "settings such as selfmodel.Settings(steps=500)")
    return settings or Settings()


def design_of(source: str | Design, robot: Robot) -> Design:
    """Returns a design of controllers for a robot, given as itself or by name."""
    check_type(source, str | Design, 'a Design or a name such as "network"')
    return plugins.design(source, robot) if isinstance(source, str) else source


def controller_of(source: object, robot: Robot) -> Controller:
    """Returns a controller, given as itself or as the path of its file; see ``read_controller``."""
    if isinstance(source, Controller):
        return source
    return read_controller(path_of(source, "a controller, or a Controller"), robot)


def check_options(on_event: object, *, calibrate: object = True) -> None:
    """Raises ``InputError`` for an observer that cannot be called, or no bool."""
    check_function("on_event", on_event)
    check_type(calibrate, bool | int | np.bool_, "True or False as calibrate")


def check_physical(self_model: Robot, *robots: object) -> None:
    """Raises ``InputError`` for an object that is no physical robot, or is one of another robot."""
    for one in robots:
        if not callable(getattr(one, "run", None)):
            raise InputError(
                f"expected a physical robot, with a method run, got {one!r:.80}: give "
                f'selfmodel.simulated_robot("quadruped"), or an EnvironmentRobot'
            )
        if isinstance(own := getattr(one, "robot", None), Robot):
            _check_names(self_model, own.anatomy.names, f"the physical robot {own.name}")


def check_trials(self_model: Robot, *trials: Trial) -> None:
    """Raises ``InputError`` for a trial of a robot with other sensors, motors or hinges."""
    for trial in trials:
        _check_names(self_model, trial.trajectory.names, f"that of {trial.path}")


def _check_names(robot: Robot, names: Names, of: str, called: str = "") -> None:
    if robot.anatomy.names != names:
        difference = describe_difference(robot.anatomy.names, names)
        raise InputError(f"{called or robot.name} is another robot than {of}: {difference}")


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
    if isinstance(source, Repertoire):
        found, named = source, "the repertoire"
    else:
        found, named = load_repertoire(path_of(source, "a repertoire")), str(source)
    check_model(found, robot, named)
    if found.design != design:
        wanted, got = (f"a {one.name} of {one.weights} weights" for one in (design, found.design))
        raise InputError(
            f"{named}: expected gaits of the controllers to evolve, {wanted}, got {got}: leave the "
            f"design out, or make a repertoire of it"
        )
    return found


def fitted(
    robot: Robot,
    trials: Sequence[Trial],
    threads: int,
    observer: Observer = ignore,
) -> Calibration:
    """Returns a self-model fitted to healthy trials, for callers that calibrate by default.

    Raises:
        InputError: The fit failed; the message names the option that omits calibration.
    """
    try:
        return calibrate(robot, trials, threads, observer)
    except InputError as error:
        raise InputError(
            f"{error}, or leave the calibration out (--no-calibrate, calibrate=False)"
        ) from error


def is_model(name: str) -> bool:
    """Returns whether a robot's name is the path of an MJCF or URDF file."""
    return Path(name).suffix.lower() in _MODEL_ENDINGS


def robot_entry(name: str, settings: Sequence[str] = ()) -> Entry:
    """Returns a robot, its cases and its tasks, by name or by MJCF or URDF file.

    Args:
        name: Name of a robot of selfmodel, or the path of an MJCF or URDF file.
        settings: Settings of the file, such as ``forward=-x``; they override those of the
            TOML file beside it.

    Raises:
        InputError: The name is unknown (the message has the nearest names), the file is no valid
            robot, or settings are given for a robot by name.
    """
    if is_model(name):
        made = load_mjcf(Path(name), _settings(name, settings))
        return Entry(robot=lambda: made)
    if settings:
        raise InputError(
            f"--set {settings[0]} is for an MJCF or URDF file: {name!r} is the name of a robot"
        )
    # dm_control would load an OpenGL library.
    os.environ.setdefault("MUJOCO_GL", "disable")
    return entry(name)


def _settings(name: str, given: Sequence[str]) -> MjcfSettings:
    extra = {key: value for text in given for key, value in parse_setting(text).items()}
    return read_settings(Path(name), extra)


def recorded_robot(name: str, control_timestep: float | None, names: Names | None = None) -> Robot:
    """Returns the robot of a recording: by name, or of a model file, adapted as for a trial.

    A model that a calibration wrote is a robot already, and is not adapted; nor is one that has the
    recorded names as it is only. Without a control time step, a model file has that of its
    settings.

    Raises:
        InputError: The name is unknown, or the model is unusable.
    """
    if not is_model(name):
        return robot_entry(name).robot()
    path, raw = Path(name), None
    if control_timestep is not None and path.suffix.lower() == ".xml":
        with suppress(InputError):  # it needs adaptation
            raw = _unadapted(path, control_timestep)
    if raw is not None and raw.is_calibrated:
        return raw
    step = {} if control_timestep is None else {"control_timestep": control_timestep}
    ready = load_mjcf(path, read_settings(path, step))
    return raw if raw is not None and ready.anatomy.names != names == raw.anatomy.names else ready


def _unadapted(path: Path, control_timestep: float) -> Robot:
    """Returns the robot of an MJCF file as it is.

    Raises:
        InputError: The model is no robot without an adaptation.
    """
    data = read_file(path, "an MJCF file", MAX_TEXT)
    try:
        check_compiles(data.decode(), {}, control_timestep)
        return Robot(encodable(path.stem), data.decode(), control_timestep)
    except (ValueError, KeyError) as error:
        raise InputError(f"{path}: expected an MJCF file of a robot: {error}") from error


def read_logs(paths: Sequence[Path]) -> list[TrialLog]:
    """Returns the trials in log files.

    Raises:
        InputError: A log is unusable, or is given twice.
    """
    with _log_errors_as_input_errors():
        found = [read_log(path) for path in paths]
    digests: dict[str, Path] = {}
    for path in paths:
        first = digests.setdefault(file_digest(path), path)
        if first is not path:
            raise InputError(f"{first} and {path} are the same log: give each log once")
    return found


@contextmanager
def _log_errors_as_input_errors() -> Iterator[None]:
    try:
        yield
    except LogError as error:
        raise InputError(str(error)) from error


def robot_of_logs(found: Sequence[TrialLog], override: str | None) -> Robot:
    """Returns the robot of at least one log, or the robot or file that replaces its model.

    Raises:
        InputError: The logs have different robots, their model is unusable, or the replacement has
            other sensors, motors or hinges.
    """
    with _log_errors_as_input_errors():
        own = common_robot(found)
    if override is None:
        return own
    names = own.anatomy.names
    chosen = recorded_robot(override, own.control_timestep, names)
    _check_names(chosen, names, f"that of {found[0].trial.path}", override)
    return chosen


def read_controller(path: Path, robot: Robot, neurons: int | None = None) -> Controller:
    """Returns the controller in a ``.npz`` file, in a trial's log, or in a policy file, ``.toml``.

    Raises:
        InputError: The file contains no controller, or one that does not fit the robot, or has
            another number of hidden neurons.
    """
    if path.suffix.lower() == ".toml":
        from selfmodel.logs.policies import read_policy  # noqa: PLC0415  # few robots have one

        policy = read_policy(path, robot)
        _check_neurons(path, policy, neurons)
        return Controller(policy, np.zeros(policy.weights))
    with _log_errors_as_input_errors():
        is_log = path.suffix.lower() == ".mcap"
        loaded = read_log(path).trial.plan.controller if is_log else load_controller(path)
    if isinstance(loaded, Playback):
        raise InputError(
            f"{path} has recorded commands and no controller: give the log of a trial that "
            f"selfmodel ran, or a .npz file"
        )
    found = loaded.design
    if found.name not in DESIGNS:
        _check_neurons(path, found, neurons)
        check_robot(found, robot, path)
        return loaded
    needed = DESIGNS[found.name](robot, (found.hidden or None) if neurons is None else neurons)
    got, expected = map(_connections, (found, needed))
    if got != expected:
        raise InputError(
            f"{path} has a controller for {got}; this robot needs one for {expected}: give a "
            f"controller of this robot"
        )
    return loaded


def check_robot(design: Design, robot: Robot, source: str | Path) -> None:
    """Checks that a design is of a robot: of its sensors, motors, command range and time step.

    Raises:
        InputError: It is of another one; the message names the source.
    """
    names = robot.anatomy.names
    if (design.sensors, design.motors) != (names.sensors, names.motors):
        raise InputError(
            f"{source} has a controller for {_connections(design)}; this robot has the sensors "
            f"{', '.join(names.sensors)} and the motors {', '.join(names.motors)}: give a "
            f"controller of this robot"
        )
    if design.name in DESIGNS:
        return
    from selfmodel.controllers.compensation import Compensated  # noqa: PLC0415  # few robots have one
    from selfmodel.controllers.policy import Policy  # noqa: PLC0415  # few robots have one

    inner = design.base.design if isinstance(design, Compensated) else design
    own = inner.interface if isinstance(inner, Policy) else None
    if own is None:
        return
    made = (design.ranges, own.hinges, own.timestep)
    if made != (command_ranges(robot.model), names.hinges, robot.control_timestep):
        raise InputError(
            f"{source} has {design.description} of a robot with other joints, another command "
            f"range or time step: give the settings of that robot with --set, or a policy file "
            f"(.toml)"
        )


def _check_neurons(path: Path, design: Design, neurons: int | None) -> None:
    if neurons is not None and neurons != design.hidden:
        raise InputError(
            f"{path} has {design.description}, got --neurons {neurons}: leave --neurons out"
        )


def _connections(design: Design) -> str:
    return (
        f"the sensors {', '.join(design.sensors)} and the motors {', '.join(design.motors)}, "
        f"{design.description}"
    )
