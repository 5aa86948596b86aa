"""Trials, robots and controllers from log files."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.experiments.robots import is_model, robot, robot_entry
from selfmodel.files import file_digest
from selfmodel.logs import LogError, TrialLog, load_controller, read_log
from selfmodel.logs.robots import common_robot, describe_difference
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import read_settings
from selfmodel.robot.robot import Robot


def logs(paths: Sequence[Path]) -> list[TrialLog]:
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


def controller(path: Path, robot: Robot, neurons: int | None = None) -> Controller:
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
