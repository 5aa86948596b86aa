"""Removes visual assets from an MJCF, so that the files of the MJCF fit into a log."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document
from selfmodel.robot.mjcf.expand import write_masses

MAX_ASSET_BYTES = 4 * 2**20
"""Largest sum of the files of a robot, bytes: every trial's log contains them."""

_REFERRING_SECTIONS = ("tendon", "sensor", "contact", "actuator", "equality", "deformable")
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_MAX_PATTERN_PIXELS = 64
"""Largest width and height of a procedural texture; each hypothesis has a copy of the model."""


def drop_visuals(document: Document, model: mujoco.MjModel) -> bool:
    """Removes skins, and also visual meshes and image textures if the files exceed a log's limit.

    Procedural textures are shrunk, so that a model takes kilobytes in place of megabytes. The
    bodies keep the masses that the removed meshes gave them.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.

    Returns:
        Whether any element was removed.

    Raises:
        InputError: The remaining files are too large.
    """
    skins = _remove_skins(document.root)
    _shrink_patterns(document)
    if _asset_bytes(document) <= MAX_ASSET_BYTES:
        _drop_unnamed_files(document)
        return bool(skins)
    write_masses(document, model)
    geoms = _drop_visual_meshes(document, model)
    _drop_image_textures(document)
    used = {geom.get("mesh") for geom in document.root.iter("geom")}
    for asset in document.root.findall("asset"):
        for mesh in [m for m in asset.findall("mesh") if m.get("name") not in used]:
            asset.remove(mesh)
    _drop_unnamed_files(document)
    document.notes.append(
        f"{geoms} visual meshes are removed, because their files are too large for a log"
    )
    if _asset_bytes(document) > MAX_ASSET_BYTES:
        raise InputError(
            f"expected files of at most {MAX_ASSET_BYTES} bytes, because every trial's log "
            f"contains them, got {_asset_bytes(document)} bytes: simplify the meshes of colliding "
            f"geoms"
        )
    return True


def _asset_bytes(document: Document) -> int:
    return sum(map(len, document.assets.values()))


def _remove_skins(root: ET.Element) -> int:
    """Removes all skins; returns their number."""
    skins = [(parent, child) for parent in root.iter() for child in parent if child.tag == "skin"]
    for parent, skin in skins:
        parent.remove(skin)
    return len(skins)


def _drop_visual_meshes(document: Document, model: mujoco.MjModel) -> int:
    """Removes mesh geoms without contacts and without references; returns their number."""
    referenced = {
        value
        for section in _REFERRING_SECTIONS
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
            visual = model.geom_type[first + number] == _MESH and not touches
            if visual and geom.get("name") not in referenced:
                element.remove(geom)
                dropped += 1
    return dropped


def _shrink_patterns(document: Document) -> None:
    """Limits the width and height of procedural textures."""
    for texture in document.root.iter("texture"):
        if texture.get("builtin", "none") != "none":
            for side in ("width", "height"):
                if int(texture.get(side, "0").strip() or 0) > _MAX_PATTERN_PIXELS:
                    texture.set(side, str(_MAX_PATTERN_PIXELS))


def _drop_image_textures(document: Document) -> None:
    """Removes textures with files, and the references of materials to them."""
    removed = set()
    for asset in document.root.findall("asset"):
        for texture in asset.findall("texture"):
            if any(attribute.startswith("file") for attribute in texture.attrib):
                removed.add(texture.get("name"))
                asset.remove(texture)
        for material in asset.findall("material"):
            if material.get("texture") in removed:
                material.attrib.pop("texture")
            for layer in [m for m in material.findall("layer") if m.get("texture") in removed]:
                material.remove(layer)


def _drop_unnamed_files(document: Document) -> None:
    """Removes the files that no element names."""
    named = {
        value
        for element in document.root.iter()
        for attribute, value in element.attrib.items()
        if attribute.startswith("file")
    }
    for name in [name for name in document.assets if name not in named]:
        document.assets.pop(name)
