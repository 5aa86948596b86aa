"""The elements of an MJCF document that belong to the parts of its compiled model."""

from collections.abc import Iterator
from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.robot.mjcf.document.document import Document


def geom_elements(document: Document, model: mujoco.MjModel) -> Iterator[tuple[int, ET.Element]]:
    """Yields the id and the element of each geom.

    Args:
        document: The MJCF, whose bodies have names.
        model: The compiled document.
    """
    bodies = {body.get("name"): body for body in document.bodies()}
    worlds = [geom for world in document.root.findall("worldbody") for geom in world]
    for body in range(model.nbody):
        children = bodies[model.body(body).name] if body else worlds
        geoms = (child for child in children if child.tag == "geom")
        yield from enumerate(geoms, int(model.body_geomadr[body]))
