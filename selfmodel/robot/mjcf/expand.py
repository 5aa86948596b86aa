"""Writes out what an MJCF only hints at, so that each part of the robot stands in the text."""

from math import prod
from xml.etree import ElementTree as ET  # of texts that were checked, or that MuJoCo wrote

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import LARGEST_READ, Document
from selfmodel.robot.mjcf.mujoco_errors import compiled, told_by_mujoco
from selfmodel.robot.mjcf.untrusted import MOST_ELEMENTS, REFUSED, checked_model

COPIES = ("replicate", "composite")
"""Elements that stand for many."""


def refuse_unloggable(document: Document) -> None:
    """Refuses what no log of a trial could carry, before MuJoCo sees it.

    Raises:
        InputError: The model asks for other models, other code, or too much of anything.
    """
    if _size(document.root) > MOST_ELEMENTS:
        raise InputError(f"its <{'> and <'.join(COPIES)}> make more than {MOST_ELEMENTS} elements")
    try:
        checked_model(document.text, document.assets, allowed=COPIES, largest_files=LARGEST_READ)
    except ValueError as error:
        raise InputError(
            f"every trial is logged with the robot's model, and this one cannot be: {error}"
        ) from error


def expand(document: Document) -> None:
    """Writes out copies and frames of reference, and the masses of a model whose sum is given.

    The model then has each body and geom that stands in the text, in the same order.
    """
    _keep_all(document)
    tags = {element.tag for element in document.root.iter()}
    used = [tag for tag in (*COPIES, "frame") if tag in tags]
    if used:
        with told_by_mujoco():
            spec = mujoco.MjSpec.from_string(document.text, assets=document.assets)
            spec.compile()
            document.root = ET.fromstring(spec.to_xml())  # noqa: S314  # MuJoCo wrote it
        document.notes.append(
            f"MuJoCo wrote out its <{'>, <'.join(used)}>, with numbers of six digits"
        )
        if any(element.tag in REFUSED for element in document.root.iter()):
            raise InputError(f"MuJoCo cannot write out its <{'>, <'.join(used)}>: do it by hand")
    compilers = list(document.root.iter("compiler"))
    if any(compiler.get("settotalmass") for compiler in compilers):
        write_masses(document, compiled(document.text, document.assets))
        document.notes.append("its masses are written out, as settotalmass scales them")


def _keep_all(document: Document) -> None:
    for compiler in document.root.iter("compiler"):
        for attribute in ("fusestatic", "discardvisual"):
            if compiler.attrib.pop(attribute, "false") == "true":
                document.notes.append(f"{attribute} is left out: each part of the text is kept")


def _size(element: ET.Element) -> int:
    """How many elements it stands for, about."""
    counts = element.get("count", "1").split() if element.tag in COPIES else ["1"]
    if not all(count.isdecimal() and len(count) < 7 for count in counts):
        raise InputError(f"its <{element.tag}> has count={element.get('count')!r}: give a number")
    return prod(map(int, counts)) * (1 + sum(_size(child) for child in element))


def write_masses(document: Document, model: mujoco.MjModel) -> None:
    """Gives each body in the text the mass and inertia that it has in the model."""
    for body, element in zip(range(1, model.nbody), document.bodies(), strict=True):
        for inertial in element.findall("inertial"):
            element.remove(inertial)
        if model.body_mass[body] == 0:
            continue
        found = {
            "pos": numbers(model.body_ipos[body]),
            "quat": numbers(model.body_iquat[body]),
            "mass": repr(float(model.body_mass[body])),
            "diaginertia": numbers(model.body_inertia[body]),
        }
        element.insert(0, ET.Element("inertial", found))
    for compiler in document.root.iter("compiler"):
        compiler.attrib.pop("settotalmass", None)
        compiler.attrib.pop("inertiafromgeom", None)
    # A body that is not told its mass has none, whatever its geoms are made of.
    document.section("compiler").set("inertiafromgeom", "false")


def numbers(values: np.ndarray) -> str:
    """Returns numbers as an attribute has them, to the last bit."""
    # MuJoCo cannot read numbers that are as good as none.
    kept = np.where(np.abs(values) < np.finfo(np.float64).tiny, 0.0, values)
    return " ".join(repr(float(value)) for value in kept)
