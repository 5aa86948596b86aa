"""What the controller is told beside the body: ranges of commands, and hidden neurons."""

from xml.etree import ElementTree as ET  # of texts that were checked

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.actuator_ranges import command_ranges, says_its_range
from selfmodel.robot.custom_numerics import NEURONS
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.mujoco_errors import compiled
from selfmodel.robot.mjcf.settings import MjcfSettings


def add_commands(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Gives motors without a range of commands the wanted one, and the network its hidden neurons.

    Raises:
        InputError: A motor does not say what it may be commanded, and nothing is wanted.
    """
    if settings.neurons is not None:
        for custom in document.root.findall("custom"):
            for numeric in [n for n in custom if n.get("name") == NEURONS]:
                custom.remove(numeric)
        told = {"name": NEURONS, "data": str(settings.neurons)}
        ET.SubElement(document.section("custom"), "numeric", told)
    if settings.ctrlrange is not None:
        ends = f"{settings.ctrlrange[0]!r} {settings.ctrlrange[1]!r}"
        for motor, element in enumerate(document.children("actuator")):
            if not says_its_range(model, motor):
                element.set("ctrlrange", ends)
                element.set("ctrllimited", "true")
    try:
        command_ranges(compiled(document.text, document.assets))
    except InputError as error:
        raise InputError(f"{error}; or say ctrlrange=[-1, 1] for all that have none") from error
