"""Expands an MJCF: copies, frames and scaled masses become explicit elements."""

from xml.etree import ElementTree as ET  # of checked texts, or of texts from MuJoCo

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.dissolve import dissolve_frames
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.untrusted import REFUSED_ELEMENTS, checked_model
from selfmodel.robot.mujoco_errors import compile_model, loading_a_model

_COPYING_ELEMENTS = ("replicate", "composite")


def check_loggable(document: Document) -> None:
    """Checks that a log can contain the model, before MuJoCo compiles the model.

    Raises:
        InputError: The model reads other models, runs other code, or is too long.
    """
    try:
        checked_model(document.text, document.assets)
    except ValueError as error:
        raise InputError(
            f"the log of a trial contains the robot's model, and cannot contain this model: {error}"
        ) from error


def expand(document: Document) -> None:
    """Expands copies, frames and ``settotalmass`` into explicit elements.

    Afterwards the compiled model has the bodies and geoms of the text, in the same order.
    """
    _keep_all_elements(document)
    tags = {element.tag for element in document.root.iter()}
    used = [tag for tag in (*_COPYING_ELEMENTS, "frame") if tag in tags]
    if used:
        with loading_a_model():
            spec = mujoco.MjSpec.from_string(document.text, assets=document.assets)
            spec.compile()
            document.root = ET.fromstring(spec.to_xml())  # noqa: S314  # the text is from MuJoCo
        dissolve_frames(document)
        document.notes.append(
            f"MuJoCo wrote out the <{'>, <'.join(used)}> elements, with numbers of six digits"
        )
        if any(element.tag in REFUSED_ELEMENTS for element in document.root.iter()):
            raise InputError(
                f"MuJoCo cannot write out the <{'>, <'.join(used)}> of the MJCF: write the copies "
                f"and frames by hand"
            )
    compilers = list(document.root.iter("compiler"))
    if any(compiler.get("settotalmass") for compiler in compilers):
        write_masses(document, compile_model(document.text, document.assets))
        document.notes.append("the masses are written out, as scaled by settotalmass")


def _keep_all_elements(document: Document) -> None:
    """Removes the compiler flags that make MuJoCo drop bodies or geoms of the text."""
    for compiler in document.root.iter("compiler"):
        for attribute in ("fusestatic", "discardvisual"):
            if compiler.attrib.pop(attribute, "false") == "true":
                document.notes.append(
                    f"{attribute} is removed: each body and geom of the file is kept"
                )


def write_masses(document: Document, model: mujoco.MjModel) -> None:
    """Writes the masses and inertias of the compiled model into the bodies of the text."""
    for body, element in zip(range(1, model.nbody), document.bodies(), strict=True):
        for existing in element.findall("inertial"):
            element.remove(existing)
        if model.body_mass[body] == 0:
            continue
        inertial = {
            "pos": format_numbers(model.body_ipos[body]),
            "quat": format_numbers(model.body_iquat[body]),
            "mass": repr(float(model.body_mass[body])),
            "diaginertia": format_numbers(model.body_inertia[body]),
        }
        element.insert(0, ET.Element("inertial", inertial))
    for compiler in document.root.iter("compiler"):
        compiler.attrib.pop("settotalmass", None)
        compiler.attrib.pop("inertiafromgeom", None)
    # A body without an <inertial> has no mass, whatever the density of its geoms.
    document.section("compiler").set("inertiafromgeom", "false")


def format_numbers(values: np.ndarray) -> str:
    """Returns numbers as the text of an attribute, exact to the last bit."""
    # MuJoCo cannot read subnormal numbers.
    normal = np.where(np.abs(values) < np.finfo(np.float64).tiny, 0.0, values)
    return " ".join(repr(float(value)) for value in normal)
