"""Loads a robot from an MJCF or URDF file: the file, adapted to what a log and a search need.

The user's file is never written. The adapted copy is one text with names, an initial pose, ground,
sensors and command ranges. It contains all properties of the robot but the control time step, so
that a log with both contains the robot.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path

import msgspec
import mujoco

from selfmodel.errors import InputError, typed
from selfmodel.files import encodable, read_file
from selfmodel.isolation import Message, run_isolated
from selfmodel.robot.mjcf import equipment, meshes, pose, structure, untrusted
from selfmodel.robot.mjcf.settings import (
    MAX_CONTROL_TIMESTEP,
    MIN_CONTROL_TIMESTEP,
    MjcfSettings,
    checked_settings,
    read_settings,
)
from selfmodel.robot.mjcf.work import Work, read_mjcf
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot, check_usable
from selfmodel.robot.urdf import read_urdf

MAX_SUBSTEPS = 1000
"""Largest number of physics steps per control step; the model of a log has the same limit."""

_MODULE = "selfmodel.robot.mjcf.load"


@typed
def load_mjcf(path: Path | str, settings: MjcfSettings | None = None) -> Robot:
    """Returns the robot that an MJCF or URDF file describes; see docs/reference/mjcf.md.

    A child process reads and compiles it.

    Args:
        path: The file, which is read only. It may include and name files of its folder, of the
            folder above in a usual layout, and of the folder ``assets`` of the settings.
        settings: Properties that the file does not contain; None for the settings of the TOML file
            of the same name.

    Raises:
        InputError: The file cannot be a robot; the message has the reason and the remedy.
    """
    file = Path(path)
    # Settings made in Python have not been validated.
    checked = read_settings(file) if settings is None else checked_settings(asdict(settings))
    data = read_file(file, "an MJCF or URDF file", untrusted.MAX_TEXT)
    request = Message({"path": str(file), "settings": asdict(checked)}, {"file": data})
    try:
        return _robot(run_isolated(f"{_MODULE}:adapt_message", request, what="the model"))
    except ValueError as error:
        raise _named(str(file), error) from error


def adapt_message(request: Message) -> Message:
    """Task of a child process: adapts the file in a message."""
    path = Path(request.header["path"])
    settings = msgspec.convert(request.header["settings"], MjcfSettings)
    root = untrusted.parse_xml(request.buffers["file"])
    files = untrusted.robot_folder(path.parent, settings.assets)
    if root.tag == "robot":
        work = read_urdf(root, files, settings)
        work.settings = replace(settings, kp={}, kd={})  # its motors are servos with these gains
    elif settings.effort or settings.velocity or settings.pose:
        raise InputError(
            "effort, velocity and pose are settings for a URDF: in an MJCF, motors have a "
            "forcerange, joints a damping, and a <key> in <keyframe> has the pose"
        )
    else:
        work = read_mjcf(root, files, settings, path.name)
    return _adapted(encodable(path.stem), work)


def adapt_text(
    name: str, mjcf: str, files: Mapping[str, bytes | str], settings: MjcfSettings
) -> Robot:
    """Returns the robot of a trusted MJCF in memory, which this process compiles.

    The files are the contents of those that the text includes and names, by the paths in it.

    Raises:
        InputError: The text cannot be a robot; the message has the reason and the remedy.
    """
    try:
        root = untrusted.parse_xml(mjcf)
        return _robot(_adapted(name, read_mjcf(root, untrusted.InMemory(files), settings)))
    except ValueError as error:
        raise _named(name, error) from error


def _robot(adapted: Message) -> Robot:
    notes = tuple(adapted.header["notes"])
    return Robot(**{**adapted.header, "notes": notes}, assets=adapted.buffers)


def _named(source: str, error: ValueError) -> InputError:
    return InputError(f"{source}: {' '.join(str(error).split())}")


def _adapted(name: str, work: Work) -> Message:
    """Returns the robot's attributes; the steps are in an order in which each finds its needs."""
    try:
        untrusted.named_files(work.root, work.assets)  # before MuJoCo compiles the model
    except InputError as error:
        raise InputError(
            f"the log of a trial contains the robot's model, and cannot contain this model: {error}"
        ) from error
    settings = work.settings
    structure.drop_large_reservations(work)
    structure.expand(work)
    structure.name_parts(work)
    for body in work.bodies():
        if body.attrib.pop("mocap", "false") == "true":
            work.notes.append(f"the mocap body {body.get('name')} is static")
    if settings.base == "free":
        pose.free_base(work)
    meshes.drop_textures(work)
    pose.carry_hinges(work)
    meshes.replace_missing_meshes(work)
    meshes.reduce_meshes(work)
    equipment.set_physics(work)
    check_usable(work.model)
    timestep = _control_timestep(work)
    structure.remove_hidden_state(work)
    pose.bake_keyframe(work)
    pose.turn_forward(work)
    if settings.base == "fixed":
        pose.fix_base(work)
    pose.add_ground(work)
    equipment.add_sensors(work)
    if settings.kp or settings.kd:
        equipment.add_servos(work)
    if settings.reach:
        equipment.limit_reach(work)
    equipment.add_command_ranges(work)
    equipment.note_stiff_servos(work)
    attributes = {"name": name, "mjcf": work.text, "control_timestep": timestep}
    files = untrusted.named_files(work.root, work.assets)
    return Message({**attributes, "notes": work.notes}, files)


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
            f"{control / physics:.3g}: set a larger timestep"
        )
    if physics > MAX_CONTROL_TIMESTEP:
        raise InputError(
            f"expected a physics time step of at most {MAX_CONTROL_TIMESTEP:g} s, got "
            f"{physics:.6g} s: set a smaller timestep"
        )
    if wanted is None:
        return max(1, math.ceil(MIN_CONTROL_TIMESTEP / physics - 1e-9)) * physics
    multiple = max(1, round(wanted / physics)) * physics
    if not math.isclose(multiple, wanted, rel_tol=1e-5):  # 1/60 s in six digits
        raise InputError(
            f"control_timestep must be a multiple of the physics time step {physics} s, got "
            f"{wanted} s"
        )
    return wanted if math.isclose(multiple, wanted, rel_tol=1e-9) else multiple


def check_compiles(mjcf: str, assets: Mapping[str, bytes], control_timestep: float) -> None:
    """Raises ``InputError`` unless a robot's model compiles and steps; the last models are kept."""
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
