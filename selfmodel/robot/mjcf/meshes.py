"""Meshes and textures of an MJCF: reduced to fit into a log, with stand-ins for missing files."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.robot.contacts import touching_geoms
from selfmodel.robot.mjcf.document import Document, format_numbers
from selfmodel.robot.mjcf.expand import write_masses

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


def reduce_meshes(document: Document) -> None:
    """Replaces meshes by convex hulls if the files exceed a log's limit.

    Meshes that are only drawn come first; then those with contacts, which MuJoCo computes with the
    convex hulls. The bodies keep the masses that the meshes gave them.

    Args:
        document: The MJCF, edited in place.

    Raises:
        InputError: The remaining files are too large.
    """
    if _asset_bytes(document) <= MAX_ASSET_BYTES:
        return
    model, geoms = document.model, list(document.geoms())
    write_masses(document)
    _write_fitted_geoms(model, geoms)
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
    return set(model.geom_dataid[(model.geom_type == _MESH) & touching_geoms(model)].tolist())


def _write_fitted_geoms(model: mujoco.MjModel, geoms: list[tuple[int, ET.Element]]) -> None:
    """Writes out the geoms that MuJoCo fits to meshes: another mesh would change them."""
    for geom, element in geoms:
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


DRAWN_POINTS = 60
"""Largest number of points of a hull that is only drawn."""

_FLATNESS = 1e-3
"""Smallest thickness of a hull that is only drawn, as a fraction of its length."""

_ATTRIBUTES = {"scale": "1 1 1", "refpos": "0 0 0", "refquat": "1 0 0 0", "inertia": "convex"}


def drawn_hull(model: mujoco.MjModel, mesh: int) -> FloatArray:
    """Returns points of a mesh with about the same convex hull, ``(points, 3)``, m.

    They are the outermost points in ``DRAWN_POINTS`` directions. A flat mesh gets a thickness,
    because MuJoCo refuses meshes without volume.
    """
    points = mesh_points(model, mesh)
    outermost = np.unique(np.argmax(points @ directions(DRAWN_POINTS).T, axis=0))
    outer: FloatArray = points[outermost]
    _, extent, axes = np.linalg.svd(outer - outer.mean(axis=0), full_matrices=False)
    if len(extent) == 3 and extent[2] >= _FLATNESS * extent[0]:
        return outer
    length = max(float(np.ptp(points, axis=0).max()), _FLATNESS)
    thickness = _FLATNESS * length * np.concatenate([axes, np.eye(3)])
    return np.concatenate([outer + shift for shift in (*thickness, *-thickness)])


def colliding_hull(model: mujoco.MjModel, mesh: int) -> FloatArray | None:
    """Returns the points of the convex hull that MuJoCo collides with, ``(points, 3)``, m.

    None if MuJoCo has computed no hull for the mesh.
    """
    start = int(model.mesh_graphadr[mesh])
    if start < 0:
        return None
    count = int(model.mesh_graph[start])
    # A graph is: points, faces, then per point the address of its edges, then its vertex.
    used = model.mesh_graph[start + 2 + count : start + 2 + 2 * count]
    return np.asarray(mesh_points(model, mesh)[used])


def mesh_points(model: mujoco.MjModel, mesh: int) -> FloatArray:
    """Returns the vertices of a mesh in the frame of its file, scaled, ``(points, 3)``, m."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[mesh])
    points = model.mesh_vert[first : first + count].astype(float)
    return np.asarray(points @ rotation.reshape(3, 3).T + model.mesh_pos[mesh])


def directions(count: int) -> FloatArray:
    """Returns unit vectors that are spread evenly on a sphere (a Fibonacci lattice)."""
    number = np.arange(count) + 0.5
    height, angle = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def write_hull(element: ET.Element, points: FloatArray, digits: int) -> None:
    """Makes a ``<mesh>`` the convex hull of points, without a file.

    Args:
        element: The ``<mesh>``, edited in place.
        points: The points, ``(points, 3)``, m.
        digits: Significant digits of the text.
    """
    name = element.get("name", "")
    element.clear()
    vertices = " ".join(f"{value:.{digits}g}" for value in points.ravel())
    element.attrib.update({"name": name, **_ATTRIBUTES, "vertex": vertices})


_KEPT = ("name", "class", "group", "rgba", "material")
"""Attributes that a box has from the geom of the mesh."""


def replace_missing_meshes(document: Document) -> None:
    """Replaces the meshes without files that have no effect on the motion.

    Args:
        document: The MJCF, edited in place, with placeholders for the meshes.

    Raises:
        InputError: A mesh has contacts, or gives a body its mass.
    """
    if not document.missing:
        return
    model = document.model
    parents = {child: parent for parent in document.root.iter() for child in parent}
    used: dict[str, list[tuple[int, ET.Element]]] = {name: [] for name in document.missing}
    for geom, element in document.geoms():
        name = _mesh_of(model, geom, element)
        if name in used:
            used[name].append((geom, element))
    for name, geoms in used.items():
        if not all(_is_visual(document, model, *geom, parents) for geom in geoms):
            raise InputError(document.missing[name])
    boxed: set[int] = set()
    for geom, element in (geom for geoms in used.values() for geom in geoms):
        body = int(model.geom_bodyid[geom])
        if body in boxed or not model.body_mass[body]:
            parents[element].remove(element)
            continue
        boxed.add(body)
        _make_inertia_box(element, model, body)
    for asset in document.root.findall("asset"):
        for mesh in [mesh for mesh in asset.findall("mesh") if mesh.get("name") in used]:
            asset.remove(mesh)
    document.notes.append(
        f"{len(used)} visual meshes have no file, such as {next(iter(used))}: each body is drawn "
        f"as the box of its inertia; assets=DIR names the folder of the files"
    )


def _mesh_of(model: mujoco.MjModel, geom: int, element: ET.Element) -> str:
    if model.geom_type[geom] == _MESH:
        return str(model.mesh(int(model.geom_dataid[geom])).name)
    return element.get("mesh", "")  # a primitive that is fitted to the mesh


def _is_visual(
    document: Document,
    model: mujoco.MjModel,
    geom: int,
    element: ET.Element,
    parents: dict[ET.Element, ET.Element],
) -> bool:
    """Returns whether a geom with a mesh affects neither contacts nor masses."""
    collides = touching_geoms(model)[geom]
    fitted = model.geom_type[geom] != _MESH
    from_geoms = any(c.get("inertiafromgeom") == "true" for c in document.root.iter("compiler"))
    measured = from_geoms or parents[element].find("inertial") is None
    massive = measured and model.body_mass[model.geom_bodyid[geom]] > 0
    return not (collides or fitted or massive)


def _make_inertia_box(element: ET.Element, model: mujoco.MjModel, body: int) -> None:
    """Makes a geom the box of even density with the mass and inertia of a body."""
    kept = {name: element.get(name, "") for name in _KEPT if element.get(name)}
    inertia = model.body_inertia[body]
    squares = 1.5 * (inertia.sum() - 2 * inertia) / model.body_mass[body]
    half = np.sqrt(np.maximum(squares, 0))
    element.clear()
    element.attrib.update(
        kept,
        type="box",
        size=format_numbers(np.maximum(half, 1e-3 * max(half.max(), 1e-3))),
        pos=format_numbers(model.body_ipos[body]),
        quat=format_numbers(model.body_iquat[body]),
        contype="0",
        conaffinity="0",
    )
