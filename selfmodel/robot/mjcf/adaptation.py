"""Adapts a user's MJCF: one text with names, an initial pose, ground, sensors and command ranges.

The user's file is never written. The adapted copy contains all properties of the robot but the
control time step, so that a log with both contains the robot.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.errors import InputError
from selfmodel.files import encodable, read_file
from selfmodel.isolation import Message, run_isolated
from selfmodel.robot.mjcf.document.document import Document, parse_xml, read_document
from selfmodel.robot.mjcf.document.expand import check_loggable, expand
from selfmodel.robot.mjcf.document.files import Files, InMemory, robot_folder
from selfmodel.robot.mjcf.document.names import name_parts
from selfmodel.robot.mjcf.hidden_state import remove_hidden_state
from selfmodel.robot.mjcf.meshes.missing_meshes import replace_missing_meshes
from selfmodel.robot.mjcf.meshes.visuals import drop_textures, reduce_meshes
from selfmodel.robot.mjcf.motors.command_ranges import add_command_ranges
from selfmodel.robot.mjcf.motors.reach import limit_reach
from selfmodel.robot.mjcf.motors.servos import add_servos
from selfmodel.robot.mjcf.placement.base import carry_hinges, fix_base, free_base
from selfmodel.robot.mjcf.placement.forward import turn_forward
from selfmodel.robot.mjcf.placement.ground import add_ground
from selfmodel.robot.mjcf.placement.keyframe import bake_keyframe
from selfmodel.robot.mjcf.reserved_memory import drop_large_reservations
from selfmodel.robot.mjcf.sensors import add_sensors
from selfmodel.robot.mjcf.settings import MAX_CONTROL_TIMESTEP, MjcfSettings, checked_settings
from selfmodel.robot.mjcf.untrusted import MAX_TEXT, checked_model
from selfmodel.robot.mjcf.usability import check_usable
from selfmodel.robot.mujoco_errors import compile_model, mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.urdf.conversion import convert
from selfmodel.robot.urdf.reading import read_urdf

MIN_CONTROL_TIMESTEP = 0.01
"""Lower bound of the default control time step, s."""

MAX_SUBSTEPS = 1000
"""Largest number of physics steps per control step; the model of a log has the same limit."""


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


def adapt(path: Path, settings: MjcfSettings) -> AdaptedMjcf:
    """Returns the adapted MJCF of a file; MuJoCo compiles the file in a child process.

    Args:
        path: The file, which may include and name files of its folder, of the folder above in a
            usual layout (``root_around``), and of the folder ``assets`` of the settings.
        settings: Properties that the file does not contain.

    Raises:
        InputError: The file cannot be a robot; the message has the reason and the remedy.
    """
    data = read_file(path, "an MJCF or URDF file", MAX_TEXT)
    try:
        files = robot_folder(path.parent, settings.assets)
        document = _read(data, files, path.name, settings)
        facts = {
            "name": encodable(path.stem),
            "model": document.text,
            "settings": asdict(replace(settings, assets="")),  # the files are read
            "notes": document.notes,
            "missing": document.missing,
        }
        request = Message(facts, document.assets)
        task = "selfmodel.robot.mjcf.adaptation:adapt_message"
        found = run_isolated(task, request, what="the model")
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    notes = tuple(found.header["notes"])
    return AdaptedMjcf(**{**found.header, "notes": notes, "assets": found.buffers})


def _read(data: bytes, files: Files, name: str, settings: MjcfSettings) -> Document:
    """Returns the document of an MJCF or of a URDF; see ``read_document`` and ``read_urdf``."""
    root = parse_xml(data)
    if root.tag == "robot":
        return read_urdf(root, files)
    if settings.effort or settings.pose:
        raise InputError(
            "effort and pose are settings for a URDF: in an MJCF, motors have a forcerange, and a "
            "<key> in <keyframe> has the pose"
        )
    return read_document(data, files, name)


def adapt_message(message: Message) -> Message:
    """Task of a child process: adapts the document in a message, and checks the robot of it."""
    facts = message.header
    root = ET.fromstring(facts["model"])  # noqa: S314  # checked
    document = Document(root, dict(message.buffers), list(facts["notes"]), facts["missing"])
    given = {name: value for name, value in facts["settings"].items() if value is not None}
    settings = checked_settings(given)
    if root.tag == "robot":
        document = convert(document, settings)
        settings = replace(settings, kp={}, kd={})  # its motors are servos with these gains
    adapted = _adapted(facts["name"], document, settings)
    with mujoco_errors_as_input_errors("use the model"):
        Robot(adapted.name, adapted.mjcf, adapted.control_timestep, adapted.assets)
    result = {
        "name": adapted.name,
        "mjcf": adapted.mjcf,
        "control_timestep": adapted.control_timestep,
        "notes": adapted.notes,
    }
    return Message(result, adapted.assets)


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
        document = read_document(mjcf.encode(), InMemory(files))
        return _adapted(name, document, settings)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _adapted(name: str, document: Document, settings: MjcfSettings) -> AdaptedMjcf:
    check_loggable(document)
    drop_large_reservations(document)
    expand(document)
    name_parts(document)
    for body in document.bodies():
        if body.attrib.pop("mocap", "false") == "true":
            document.notes.append(f"the mocap body {body.get('name')} is static")
    if settings.base == "free":
        free_base(document, compile_model(document.text, document.assets))
    model = _compiled_for_a_log(document)
    check_usable(model)
    remove_hidden_state(document, model)
    timestep = _control_timestep(float(model.opt.timestep), settings.control_timestep)
    bake_keyframe(document, model, settings)
    turn_forward(document, compile_model(document.text, document.assets), settings)
    if settings.base == "fixed":
        fix_base(document, compile_model(document.text, document.assets), settings.base_height)
    add_ground(document, compile_model(document.text, document.assets))
    add_sensors(document, compile_model(document.text, document.assets), settings)
    if settings.kp or settings.kd:
        add_servos(document, compile_model(document.text, document.assets), settings)
    if settings.reach:
        limit_reach(document, compile_model(document.text, document.assets), settings.reach)
    add_command_ranges(document, compile_model(document.text, document.assets), settings)
    try:
        checked = checked_model(document.text, document.assets)
    except ValueError as error:
        raise InputError(f"a log cannot contain the model: {error}") from error
    return AdaptedMjcf(
        name=name,
        mjcf=checked.mjcf,
        control_timestep=timestep,
        assets=checked.files,
        notes=tuple(document.notes),
    )


def _compiled_for_a_log(document: Document) -> mujoco.MjModel:
    """Returns the compiled document, after the changes to bodies and files that a log needs."""
    drop_textures(document)
    model = compile_model(document.text, document.assets)
    for change in (carry_hinges, replace_missing_meshes, reduce_meshes):
        if change(document, model):
            model = compile_model(document.text, document.assets)
    return model


def _control_timestep(physics: float, wanted: float | None) -> float:
    """Returns the control time step, s.

    Args:
        physics: Physics time step, s.
        wanted: Control time step in the settings, s; None for the smallest multiple of the physics
            time step that is at least ``MIN_CONTROL_TIMESTEP``.

    Raises:
        InputError: The control time step has more than ``MAX_SUBSTEPS`` physics steps, or is not a
            multiple of the physics time step; or the physics time step is too large.
    """
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
