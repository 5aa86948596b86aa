"""Loads a robot from an MJCF or URDF file: the file, adapted to what a log and a search need.

The user's file is never written. The adapted copy is one text with names, an initial pose, ground,
sensors and command ranges. It contains all properties of the robot but the control time step, so
that a log with both contains the robot.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

import msgspec
import mujoco

from selfmodel.errors import InputError
from selfmodel.files import encodable, read_file
from selfmodel.isolation import Message, run_isolated
from selfmodel.robot.mjcf.equipment import (
    add_command_ranges,
    add_sensors,
    add_servos,
    limit_reach,
)
from selfmodel.robot.mjcf.meshes import drop_textures, reduce_meshes, replace_missing_meshes
from selfmodel.robot.mjcf.pose import (
    add_ground,
    bake_keyframe,
    carry_hinges,
    fix_base,
    free_base,
    turn_forward,
)
from selfmodel.robot.mjcf.settings import (
    MAX_CONTROL_TIMESTEP,
    MjcfSettings,
    checked_settings,
    read_settings,
)
from selfmodel.robot.mjcf.structure import (
    drop_large_reservations,
    expand,
    name_parts,
    remove_hidden_state,
)
from selfmodel.robot.mjcf.untrusted import (
    MAX_TEXT,
    InMemory,
    named_files,
    parse_xml,
    robot_folder,
)
from selfmodel.robot.mjcf.work import Work, read_mjcf
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot, check_usable
from selfmodel.robot.urdf import read_urdf

MIN_CONTROL_TIMESTEP = 0.01
"""Lower bound of the default control time step, s."""

MAX_SUBSTEPS = 1000
"""Largest number of physics steps per control step; the model of a log has the same limit."""

_MODULE = "selfmodel.robot.mjcf.load"


@dataclass(frozen=True, eq=False)
class AdaptedMjcf:
    """An MJCF after adaptation to the requirements of a robot.

    Attributes:
        name: Name of the robot.
        mjcf: The MJCF as one XML text without includes; ``assets`` contains its files.
        control_timestep: Time between two commands, s.
        assets: Contents of the files that the text names, by name.
        notes: Descriptions of the changes to the user's text, one sentence each.
    """

    name: str
    mjcf: str
    control_timestep: float
    assets: Mapping[str, bytes]
    notes: tuple[str, ...]


def load_mjcf(path: Path | str, settings: MjcfSettings | None = None) -> Robot:
    """Returns the robot that an MJCF or URDF file describes; see docs/reference/mjcf.md.

    Args:
        path: The file, which is read only. It may name the files that ``adapt`` describes.
        settings: Properties that the file does not contain; None for the settings of the TOML file
            of the same name.

    Raises:
        InputError: The file cannot be a robot; the message has the reason and the remedy.
    """
    file = Path(path)
    # Settings made in Python have not been validated.
    checked = read_settings(file) if settings is None else checked_settings(asdict(settings))
    adapted = adapt(file, checked)
    return robot_from(adapted, str(file))


def robot_from(adapted: AdaptedMjcf, source: str) -> Robot:
    """Returns the robot of an adapted MJCF.

    Args:
        adapted: Adapted MJCF, as returned by ``adapt`` or ``adapt_text``.
        source: The name of the MJCF in an error message.

    Raises:
        InputError: The adapted model is no valid robot.
    """
    try:
        return Robot(adapted.name, adapted.mjcf, adapted.control_timestep, adapted.assets)
    except ValueError as error:
        raise InputError(f"{source}: {' '.join(str(error).split())}") from error


def adapt(path: Path, settings: MjcfSettings) -> AdaptedMjcf:
    """Returns the adapted MJCF of a file, which a child process reads and compiles.

    Args:
        path: The file, which may include and name files of its folder, of the folder above in a
            usual layout (``root_around``), and of the folder ``assets`` of the settings.
        settings: Properties that the file does not contain.

    Raises:
        InputError: The file cannot be a robot; the message has the reason and the remedy.
    """
    data = read_file(path, "an MJCF or URDF file", MAX_TEXT)
    request = Message({"path": str(path), "settings": asdict(settings)}, {"file": data})
    try:
        answer = run_isolated(f"{_MODULE}:adapt_message", request, what="the model")
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    notes = tuple(answer.header["notes"])
    return AdaptedMjcf(**{**answer.header, "notes": notes, "assets": answer.buffers})


def adapt_message(request: Message) -> Message:
    """Task of a child process: adapts the file in a message."""
    path = Path(request.header["path"])
    settings = msgspec.convert(request.header["settings"], MjcfSettings)
    root = parse_xml(request.buffers["file"])
    files = robot_folder(path.parent, settings.assets)
    if root.tag == "robot":
        work = read_urdf(root, files, settings)
        work.settings = replace(settings, kp={}, kd={})  # its motors are servos with these gains
    elif settings.effort or settings.pose:
        raise InputError(
            "effort and pose are settings for a URDF: in an MJCF, motors have a forcerange, and a "
            "<key> in <keyframe> has the pose"
        )
    else:
        work = read_mjcf(root, files, settings, path.name)
    adapted = _adapted(encodable(path.stem), work)
    header = {name: value for name, value in vars(adapted).items() if name != "assets"}
    return Message(header, adapted.assets)


def adapt_text(
    name: str, mjcf: str, files: Mapping[str, bytes | str], settings: MjcfSettings
) -> AdaptedMjcf:
    """Returns the adapted MJCF of a trusted text in memory, which this process compiles.

    Args:
        name: Name of the robot.
        mjcf: The MJCF as text.
        files: Contents of the files that the text includes and names, by the paths in the text.
        settings: Properties that the text does not contain.

    Raises:
        InputError: The text cannot be a robot; the message has the reason and the remedy.
    """
    try:
        return _adapted(name, read_mjcf(parse_xml(mjcf), InMemory(files), settings))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _adapted(name: str, work: Work) -> AdaptedMjcf:
    """Returns the adapted MJCF; the steps are in an order in which each finds what it needs."""
    try:
        named_files(work.root, work.assets)  # before MuJoCo compiles the model
    except InputError as error:
        raise InputError(
            f"the log of a trial contains the robot's model, and cannot contain this model: {error}"
        ) from error
    drop_large_reservations(work)
    expand(work)
    name_parts(work)
    for body in work.bodies():
        if body.attrib.pop("mocap", "false") == "true":
            work.notes.append(f"the mocap body {body.get('name')} is static")
    if work.settings.base == "free":
        free_base(work)
    drop_textures(work)
    carry_hinges(work)
    replace_missing_meshes(work)
    reduce_meshes(work)
    check_usable(work.model)
    timestep = _control_timestep(work)
    remove_hidden_state(work)
    bake_keyframe(work)
    turn_forward(work)
    if work.settings.base == "fixed":
        fix_base(work)
    add_ground(work)
    add_sensors(work)
    if work.settings.kp or work.settings.kd:
        add_servos(work)
    if work.settings.reach:
        limit_reach(work)
    add_command_ranges(work)
    files = named_files(work.root, work.assets)
    return AdaptedMjcf(name, work.text, timestep, files, tuple(work.notes))


def _control_timestep(work: Work) -> float:
    """Returns the control time step, s.

    By default it is the smallest multiple of the physics time step that is at least
    ``MIN_CONTROL_TIMESTEP``.
    """
    physics, wanted = float(work.model.opt.timestep), work.settings.control_timestep
    control = MIN_CONTROL_TIMESTEP if wanted is None else wanted
    if control / physics > MAX_SUBSTEPS:
        raise InputError(
            f"expected at most {MAX_SUBSTEPS} physics steps in a control step of {control} s, got "
            f"{control / physics:.3g}: give the MJCF a larger <option timestep>"
        )
    if physics > MAX_CONTROL_TIMESTEP:
        raise InputError(
            f"expected a physics time step of at most {MAX_CONTROL_TIMESTEP:g} s, got "
            f"{physics:.6g} s: give the MJCF a smaller <option timestep>"
        )
    if wanted is None:
        return max(1, math.ceil(MIN_CONTROL_TIMESTEP / physics - 1e-9)) * physics
    if not math.isclose(max(1, round(wanted / physics)) * physics, wanted, rel_tol=1e-9):
        raise InputError(
            f"control_timestep must be a multiple of the physics time step {physics} s, got "
            f"{wanted} s"
        )
    return wanted


def check_compiles(mjcf: str, assets: Mapping[str, bytes], control_timestep: float) -> None:
    """Checks that a robot's model can be compiled and stepped; once for each of the last models.

    Args:
        mjcf: The MJCF as one text without includes.
        assets: Contents of the files that the MJCF names, by name.
        control_timestep: Time between two commands, s.

    Raises:
        InputError: The model cannot be compiled, or is no valid robot.
    """
    _check(mjcf, tuple(assets.items()), control_timestep)


@lru_cache(8)
def _check(mjcf: str, assets: tuple[tuple[str, bytes], ...], control_timestep: float) -> None:
    header = {"mjcf": mjcf, "control_timestep": control_timestep}
    run_isolated(f"{_MODULE}:build_and_step", Message(header, dict(assets)), what="the model")


def build_and_step(request: Message) -> Message:
    """Task of a child process: builds a robot and takes a step of its physics."""
    header = request.header
    with mujoco_errors_as_input_errors("use the model"):
        robot = Robot("robot", header["mjcf"], header["control_timestep"], request.buffers)
        data = mujoco.MjData(robot.model)
    with suppress(mujoco.FatalError):  # such as too many contacts: a simulation that diverges
        mujoco.mj_step(robot.model, data)
    return Message({})
