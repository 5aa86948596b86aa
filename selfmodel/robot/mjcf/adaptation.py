"""Anybody's MJCF made ready: one text with names, a start, ground and sensors.

The user's file is read and never written. What is changed is changed in a copy, which says all
that there is to say about the robot, so that a log that carries it carries the robot.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from selfmodel.errors import InputError
from selfmodel.files import read_file
from selfmodel.robot.mjcf.command_ranges import add_command_ranges
from selfmodel.robot.mjcf.document import Document, read_document
from selfmodel.robot.mjcf.expand import expand, refuse_unloggable
from selfmodel.robot.mjcf.files import Folder, InMemory
from selfmodel.robot.mjcf.ground import add_ground
from selfmodel.robot.mjcf.mujoco_errors import compiled
from selfmodel.robot.mjcf.names import name_parts
from selfmodel.robot.mjcf.pose import bake_keyframe, turn_forward
from selfmodel.robot.mjcf.refusals import refuse_unusable
from selfmodel.robot.mjcf.sensors import add_sensors
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mjcf.untrusted import LARGEST, checked_model
from selfmodel.robot.mjcf.visuals import drop_visuals

CONTROL_TIMESTEP = 0.01
"""Seconds between two commands that are wanted where nothing else is said."""


MOST_SUBSTEPS = 1000
"""Physics steps in a control step that the log of a trial may tell of."""


@dataclass(frozen=True, eq=False)
class Adapted:
    """An MJCF that is ready to be a robot.

    Attributes:
        name: What the robot is called.
        mjcf: One XML text that needs no files but the assets.
        control_timestep: Seconds between two commands.
        assets: The files that the text names.
        notes: What was done to the user's text, a sentence each.
    """

    name: str
    mjcf: str
    control_timestep: float
    assets: Mapping[str, bytes]
    notes: tuple[str, ...]


def adapt(path: Path, settings: MjcfSettings) -> Adapted:
    """Returns the robot of an MJCF file, made ready.

    Args:
        path: The file; what it includes and names is read from its folder and below.
        settings: What the file itself does not tell.

    Raises:
        InputError: The file cannot be used; the sentence says why, and what to do.
    """
    data = read_file(path, "an MJCF file", LARGEST)
    try:
        document = read_document(data, Folder(path.parent), path.name)
        return _adapted(path.stem, document, settings)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def adapt_text(
    name: str, mjcf: str, files: Mapping[str, bytes | str], settings: MjcfSettings
) -> Adapted:
    """Returns the robot of an MJCF in memory, made ready; see ``adapt``.

    Args:
        name: What the robot is called.
        mjcf: The text.
        files: What it includes and names, by the paths that it says.
        settings: What the text itself does not tell.
    """
    try:
        return _adapted(name, read_document(mjcf.encode(), InMemory(files)), settings)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _adapted(name: str, document: Document, settings: MjcfSettings) -> Adapted:
    refuse_unloggable(document)
    expand(document)
    name_parts(document)
    for body in document.bodies():
        if body.attrib.pop("mocap", "false") == "true":
            document.notes.append(f"the mocap body {body.get('name')} stands still")
    model = compiled(document.text, document.assets)
    if drop_visuals(document, model):
        model = compiled(document.text, document.assets)
    refuse_unusable(model)
    timestep = _control_timestep(float(model.opt.timestep), settings.control_timestep)
    bake_keyframe(document, model, settings)
    turn_forward(document, compiled(document.text, document.assets), settings)
    add_ground(document, compiled(document.text, document.assets))
    add_sensors(document, compiled(document.text, document.assets), settings)
    add_command_ranges(document, model, settings)
    try:
        checked = checked_model(document.text, document.assets)
    except ValueError as error:
        raise InputError(f"no log could carry it: {error}") from error
    return Adapted(
        name=name,
        mjcf=checked.mjcf,
        control_timestep=timestep,
        assets=checked.files,
        notes=tuple(document.notes),
    )


def _control_timestep(physics: float, wanted: float | None) -> float:
    """The wanted step, or the smallest multiple of the physics' that is not below 0.01 s."""
    control = CONTROL_TIMESTEP if wanted is None else wanted
    if control / physics > MOST_SUBSTEPS:
        raise InputError(
            f"its physics take {control / physics:.3g} steps in a control step of {control} s, "
            f"more than {MOST_SUBSTEPS}: give it a larger <option timestep>"
        )
    if wanted is None:
        return max(1, math.ceil(CONTROL_TIMESTEP / physics - 1e-9)) * physics
    if not math.isclose(max(1, round(wanted / physics)) * physics, wanted, rel_tol=1e-9):
        raise InputError(
            f"control_timestep must be a multiple of the physics time step {physics} s, got "
            f"{wanted} s"
        )
    return wanted
