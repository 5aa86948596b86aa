"""Meshes and textures of an MJCF: reduced to fit into a log, with stand-ins for missing files."""

from collections.abc import Mapping
from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.robot.contacts import touching_geoms
from selfmodel.robot.mjcf.structure import write_masses
from selfmodel.robot.mjcf.work import Work, format_numbers

MAX_ASSET_BYTES = 4 * 2**20
"""Largest sum of the files of a robot, bytes: every trial's log contains them."""

DRAWN_POINTS = 60
"""Largest number of points of a hull that is only drawn."""

_FLATNESS = 1e-3
"""Smallest thickness of a hull that is only drawn, as a fraction of its length."""

_MAX_PATTERN_PIXELS = 64
"""Largest width and height of a procedural texture; each hypothesis has a copy of the model."""

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_FRAME_ATTRIBUTES = ("mesh", "fitscale", "fromto", "axisangle", "xyaxes", "zaxis", "euler")
_BOX_KEEPS = ("name", "class", "group", "rgba", "material")


def drop_textures(work: Work) -> None:
    """Removes skins, and also image textures if the files exceed a log's limit.

    Procedural textures are shrunk, so that a model takes kilobytes in place of megabytes.
    """
    for parent in list(work.root.iter()):
        for skin in parent.findall("skin"):
            parent.remove(skin)
    for texture in work.root.iter("texture"):
        if texture.get("builtin", "none") != "none":
            for side in ("width", "height"):
                if int(texture.get(side, "0").strip() or 0) > _MAX_PATTERN_PIXELS:
                    texture.set(side, str(_MAX_PATTERN_PIXELS))
    if _asset_bytes(work) > MAX_ASSET_BYTES:
        _drop_image_textures(work)


def _drop_image_textures(work: Work) -> None:
    removed = set()
    for asset in work.root.findall("asset"):
        for texture in asset.findall("texture"):
            if any(attribute.startswith("file") for attribute in texture.attrib):
                removed.add(texture.get("name"))
                asset.remove(texture)
        for material in asset.findall("material"):
            if material.get("texture") in removed:
                material.attrib.pop("texture")
            for layer in material.findall("layer"):
                if layer.get("texture") in removed:
                    material.remove(layer)


def _asset_bytes(work: Work) -> int:
    attributes = (item for element in work.root.iter() for item in element.attrib.items())
    named = {name for attribute, name in attributes if attribute.startswith("file")}
    return sum(len(work.assets[name]) for name in named if name)


def reduce_meshes(work: Work) -> None:
    """Replaces meshes by convex hulls if the files exceed a log's limit.

    Meshes that are only drawn come first; then those with contacts, which MuJoCo computes with the
    convex hulls. The bodies keep the masses that the meshes gave them.
    """
    if _asset_bytes(work) <= MAX_ASSET_BYTES:
        return
    model, geoms = work.model, list(work.geoms())
    write_masses(work)
    for geom, element in geoms:
        if element.get("mesh") and model.geom_type[geom] != _MESH:
            _write_fitted(element, model, geom)
    elements = {e.get("name"): e for asset in work.root.findall("asset") for e in asset}
    meshes = {m: elements[model.mesh(m).name] for m in range(model.nmesh)}
    touching = (model.geom_type == _MESH) & touching_geoms(model)
    colliding = sorted(set(model.geom_dataid[touching].tolist()))
    drawn = [m for m, e in meshes.items() if m not in colliding and e.get("file")]
    for mesh in drawn:
        _write_hull(meshes[mesh], _drawn_hull(model, mesh), digits=5)
    if drawn:
        work.notes.append(
            f"{len(drawn)} visual meshes are drawn as convex hulls of about {DRAWN_POINTS} points, "
            f"because their files are too large for a log"
        )
    if _asset_bytes(work) > MAX_ASSET_BYTES:
        solid = [m for m in colliding if model.mesh_graphadr[m] >= 0 and meshes[m].get("file")]
        for mesh in solid:
            _write_hull(meshes[mesh], _colliding_hull(model, mesh), digits=9)
        work.notes.append(
            f"{len(solid)} meshes with contacts are replaced by their convex hulls, with which "
            f"MuJoCo computes contacts, because their files are too large for a log"
        )
    if (size := _asset_bytes(work)) > MAX_ASSET_BYTES:
        raise InputError(
            f"expected files of at most {MAX_ASSET_BYTES} bytes, because every trial's log "
            f"contains them, got {size} bytes: use smaller height fields"
        )


def _write_fitted(element: ET.Element, model: mujoco.MjModel, geom: int) -> None:
    """Writes out a geom that MuJoCo fits to a mesh: another mesh would change it."""
    for attribute in _FRAME_ATTRIBUTES:
        element.attrib.pop(attribute, None)
    for attribute in ("pos", "quat", "size"):
        element.set(attribute, format_numbers(getattr(model, f"geom_{attribute}")[geom]))


def _drawn_hull(model: mujoco.MjModel, mesh: int) -> FloatArray:
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


def _colliding_hull(model: mujoco.MjModel, mesh: int) -> FloatArray:
    """Returns the points of the convex hull that MuJoCo collides with, ``(points, 3)``, m."""
    start = int(model.mesh_graphadr[mesh])
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


def _write_hull(element: ET.Element, points: FloatArray, digits: int) -> None:
    """Makes a ``<mesh>`` the convex hull of points, ``(points, 3)`` m, without a file."""
    name = element.get("name", "")
    element.clear()
    element.attrib = {
        "name": name,
        "scale": "1 1 1",
        "refpos": "0 0 0",
        "refquat": "1 0 0 0",
        "inertia": "convex",
        "vertex": " ".join(f"{value:.{digits}g}" for value in points.ravel()),
    }


def replace_missing_meshes(work: Work) -> None:
    """Replaces the meshes without files that have no effect on the motion."""
    if not work.missing:
        return
    model = work.model
    parents = {child: parent for parent in work.root.iter() for child in parent}
    used: dict[str, list[tuple[int, ET.Element]]] = {name: [] for name in work.missing}
    for geom, element in work.geoms():
        is_mesh = model.geom_type[geom] == _MESH  # others may be fitted to a mesh
        mesh = model.mesh(model.geom_dataid[geom]).name if is_mesh else element.get("mesh")
        if mesh in used:
            used[mesh].append((geom, element))
    for name, geoms in used.items():
        if not all(_is_visual(work, *geom, parents) for geom in geoms):
            raise InputError(work.missing[name])
    boxed: set[int] = set()
    for geom, element in (geom for geoms in used.values() for geom in geoms):
        body = int(model.geom_bodyid[geom])
        if body in boxed or not model.body_mass[body]:
            parents[element].remove(element)
            continue
        boxed.add(body)
        _make_inertia_box(element, model, body)
    for asset in work.root.findall("asset"):
        for unused in [e for e in asset.findall("mesh") if e.get("name") in used]:
            asset.remove(unused)
    work.notes.append(
        f"{len(used)} visual meshes have no file, such as {next(iter(used))}: each body is drawn "
        f"as the box of its inertia; assets=DIR names the folder of the files"
    )


def _is_visual(
    work: Work, geom: int, element: ET.Element, parents: Mapping[ET.Element, ET.Element]
) -> bool:
    """Returns whether a geom with a mesh affects neither contacts nor masses."""
    model = work.model
    collides = touching_geoms(model)[geom]
    fitted = model.geom_type[geom] != _MESH
    from_geoms = any(c.get("inertiafromgeom") == "true" for c in work.root.iter("compiler"))
    measured = from_geoms or parents[element].find("inertial") is None
    massive = measured and model.body_mass[model.geom_bodyid[geom]] > 0
    return not (collides or fitted or massive)


def _make_inertia_box(element: ET.Element, model: mujoco.MjModel, body: int) -> None:
    """Makes a geom the box of even density with the mass and inertia of a body."""
    inertia = model.body_inertia[body]
    squares = 1.5 * (inertia.sum() - 2 * inertia) / model.body_mass[body]
    half = np.sqrt(np.maximum(squares, 0))
    kept = {name: element.get(name, "") for name in _BOX_KEEPS if element.get(name)}
    element.clear()
    element.attrib = kept | {
        "type": "box",
        "size": format_numbers(np.maximum(half, 1e-3 * max(half.max(), 1e-3))),
        "pos": format_numbers(model.body_ipos[body]),
        "quat": format_numbers(model.body_iquat[body]),
        "contype": "0",
        "conaffinity": "0",
    }
