"""Takes out of a model what is only seen, where a log could not carry all its files."""

from xml.etree import ElementTree as ET  # of texts that were checked

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import write_masses
from selfmodel.robot.mjcf.untrusted import LARGEST_FILES

_MEANT_BY_NAME = ("tendon", "sensor", "contact", "actuator", "equality", "deformable")
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_PIXELS = 64
"""Width and height of a pattern that MuJoCo makes: each hypothesis has a copy of the model."""


def drop_visuals(document: Document, model: mujoco.MjModel) -> bool:
    """Takes out skins; and meshes and pictures that nothing can touch, if the files are too large.

    Patterns that MuJoCo makes become small, so that a model takes kilobytes and not megabytes. The
    bodies keep the masses that the meshes gave them.

    Returns:
        Whether anything was taken out.

    Raises:
        InputError: What is left is still too large.
    """
    skins = _remove(document.root, ("skin",))
    _shrink_patterns(document)
    before = _bytes(document)
    if before <= LARGEST_FILES:
        _forget_files(document)
        return bool(skins)
    write_masses(document, model)
    geoms = _drop_geoms(document, model)
    _drop_pictures(document)
    used = {geom.get("mesh") for geom in document.root.iter("geom")}
    for asset in document.root.findall("asset"):
        for mesh in [m for m in asset.findall("mesh") if m.get("name") not in used]:
            asset.remove(mesh)
    _forget_files(document)
    document.notes.append(
        f"{geoms} meshes that are only seen are left out, because a log could not carry their files"
    )
    if _bytes(document) > LARGEST_FILES:
        raise InputError(
            f"its files have {_bytes(document)} bytes, and every trial's log carries them, "
            f"{LARGEST_FILES} at most: simplify the meshes that it touches things with"
        )
    return True


def _bytes(document: Document) -> int:
    return sum(map(len, document.assets.values()))


def _remove(root: ET.Element, tags: tuple[str, ...]) -> int:
    found = [(parent, child) for parent in root.iter() for child in parent if child.tag in tags]
    for parent, child in found:
        parent.remove(child)
    return len(found)


def _drop_geoms(document: Document, model: mujoco.MjModel) -> int:
    """Takes out the mesh geoms that nothing can touch and nothing else names; returns how many."""
    meant = {
        value
        for section in _MEANT_BY_NAME
        for part in document.root.findall(section)
        for element in part.iter()
        for value in element.attrib.values()
    }
    dropped = 0
    elements = {body.get("name"): body for body in document.bodies()}
    for body in range(1, model.nbody):
        element = elements[model.body(body).name]
        first = int(model.body_geomadr[body])
        for number, geom in enumerate(element.findall("geom")):
            touches = model.geom_contype[first + number] | model.geom_conaffinity[first + number]
            seen = model.geom_type[first + number] == _MESH and not touches
            if seen and geom.get("name") not in meant:
                element.remove(geom)
                dropped += 1
    return dropped


def _shrink_patterns(document: Document) -> None:
    for texture in document.root.iter("texture"):
        if texture.get("builtin", "none") != "none":
            for side in ("width", "height"):
                if int(texture.get(side, "0").strip() or 0) > _PIXELS:
                    texture.set(side, str(_PIXELS))


def _drop_pictures(document: Document) -> None:
    """Takes out textures that come from files, and leaves their materials without them."""
    gone = set()
    for asset in document.root.findall("asset"):
        for texture in asset.findall("texture"):
            if any(attribute.startswith("file") for attribute in texture.attrib):
                gone.add(texture.get("name"))
                asset.remove(texture)
        for material in asset.findall("material"):
            if material.get("texture") in gone:
                material.attrib.pop("texture")
            for layer in [m for m in material.findall("layer") if m.get("texture") in gone]:
                material.remove(layer)


def _forget_files(document: Document) -> None:
    named = {
        value
        for element in document.root.iter()
        for attribute, value in element.attrib.items()
        if attribute.startswith("file")
    }
    for name in [name for name in document.assets if name not in named]:
        document.assets.pop(name)
