"""Reduces the visual assets and the meshes of an MJCF, so that its files fit into a log."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.contacts import contact_pairs
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.elements import geom_elements
from selfmodel.robot.mjcf.document.expand import format_numbers, write_masses
from selfmodel.robot.mjcf.meshes.hulls import DRAWN_POINTS, colliding_hull, drawn_hull, write_hull

MAX_ASSET_BYTES = 4 * 2**20
"""Largest sum of the files of a robot, bytes: every trial's log contains them."""

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_FRAME_ATTRIBUTES = ("mesh", "fitscale", "fromto", "axisangle", "xyaxes", "zaxis", "euler")
_MAX_PATTERN_PIXELS = 64
"""Largest width and height of a procedural texture; each hypothesis has a copy of the model."""


def drop_textures(document: Document) -> None:
    """Removes skins, and also image textures if the files exceed a log's limit.

    Procedural textures are shrunk, so that a model takes kilobytes in place of megabytes.
    """
    _remove_skins(document.root)
    _shrink_patterns(document)
    if _asset_bytes(document) > MAX_ASSET_BYTES:
        _drop_image_textures(document)
    _drop_unnamed_files(document)


def reduce_meshes(document: Document, model: mujoco.MjModel) -> bool:
    """Replaces meshes by convex hulls if the files exceed a log's limit.

    Meshes that are only drawn come first; then those with contacts, which MuJoCo computes with the
    convex hulls. The bodies keep the masses that the meshes gave them.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.

    Returns:
        Whether any mesh was replaced.

    Raises:
        InputError: The remaining files are too large.
    """
    if _asset_bytes(document) <= MAX_ASSET_BYTES:
        return False
    write_masses(document, model)
    _write_fitted_geoms(document, model)
    elements = {e.get("name"): e for asset in document.root.findall("asset") for e in asset}
    colliding = _colliding_meshes(model)
    meshes = {m: elements[model.mesh(m).name] for m in range(model.nmesh)}
    drawn = [m for m, e in meshes.items() if m not in colliding and e.get("file")]
    for mesh in drawn:
        write_hull(meshes[mesh], drawn_hull(model, mesh), digits=5)
    if drawn:
        document.notes.append(
            f"{len(drawn)} visual meshes are drawn as convex hulls of about {DRAWN_POINTS} points, "
            f"because their files are too large for a log"
        )
    _drop_unnamed_files(document)
    if _asset_bytes(document) > MAX_ASSET_BYTES:
        _write_colliding_hulls(document, model, {m: meshes[m] for m in sorted(colliding)})
    _drop_unnamed_files(document)
    if _asset_bytes(document) > MAX_ASSET_BYTES:
        raise InputError(
            f"expected files of at most {MAX_ASSET_BYTES} bytes, because every trial's log "
            f"contains them, got {_asset_bytes(document)} bytes: use smaller height fields"
        )
    return True


def _write_colliding_hulls(
    document: Document, model: mujoco.MjModel, meshes: dict[int, ET.Element]
) -> None:
    """Replaces meshes with contacts by the convex hulls with which MuJoCo computes the contacts."""
    replaced = 0
    for mesh, element in meshes.items():
        points = colliding_hull(model, mesh)
        if points is not None and element.get("file"):
            write_hull(element, points, digits=9)
            replaced += 1
    document.notes.append(
        f"{replaced} meshes with contacts are replaced by their convex hulls, with which MuJoCo "
        f"computes contacts, because their files are too large for a log"
    )


def _colliding_meshes(model: mujoco.MjModel) -> set[int]:
    """Returns the ids of the meshes of geoms with a contact mask or a contact pair."""
    paired = {geom for pair in contact_pairs(model) for geom in pair}
    return {
        int(model.geom_dataid[geom])
        for geom in range(model.ngeom)
        if model.geom_type[geom] == _MESH
        and (model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired)
    }


def _write_fitted_geoms(document: Document, model: mujoco.MjModel) -> None:
    """Writes out the geoms that MuJoCo fits to meshes: another mesh would change them."""
    for geom, element in geom_elements(document, model):
        if element.get("mesh") and model.geom_type[geom] != _MESH:
            for attribute in _FRAME_ATTRIBUTES:
                element.attrib.pop(attribute, None)
            element.set("pos", format_numbers(model.geom_pos[geom]))
            element.set("quat", format_numbers(model.geom_quat[geom]))
            element.set("size", format_numbers(model.geom_size[geom]))


def _asset_bytes(document: Document) -> int:
    return sum(map(len, document.assets.values()))


def _remove_skins(root: ET.Element) -> None:
    skins = [(parent, child) for parent in root.iter() for child in parent if child.tag == "skin"]
    for parent, skin in skins:
        parent.remove(skin)


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
