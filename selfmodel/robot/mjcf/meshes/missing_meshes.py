"""Visual meshes without files: the boxes of the bodies' inertias are drawn in their places.

Packages such as mujoco_playground have MJCF files without the meshes, which are elsewhere.
"""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.contacts import contact_pairs
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.document.elements import geom_elements
from selfmodel.robot.mjcf.document.expand import format_numbers

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_KEPT = ("name", "class", "group", "rgba", "material")
"""Attributes that a box has from the geom of the mesh."""


def replace_missing_meshes(document: Document, model: mujoco.MjModel) -> bool:
    """Replaces the meshes without files that have no effect on the motion.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document, with placeholders for the meshes.

    Returns:
        Whether there were any.

    Raises:
        InputError: A mesh has contacts, or gives a body its mass.
    """
    if not document.missing:
        return False
    parents = {child: parent for parent in document.root.iter() for child in parent}
    used: dict[str, list[tuple[int, ET.Element]]] = {name: [] for name in document.missing}
    for geom, element in geom_elements(document, model):
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
    return True


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
    collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
    paired = any(geom in pair for pair in contact_pairs(model))
    fitted = model.geom_type[geom] != _MESH
    from_geoms = any(c.get("inertiafromgeom") == "true" for c in document.root.iter("compiler"))
    measured = from_geoms or parents[element].find("inertial") is None
    massive = measured and model.body_mass[model.geom_bodyid[geom]] > 0
    return not (collides or paired or fitted or massive)


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
