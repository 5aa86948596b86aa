"""Dissolves the ``<frame>`` elements of an MJCF that MuJoCo has written out.

The children of a frame become children of the body around it, in the same order, with the poses of
the compiled model.
"""

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from xml.etree import ElementTree as ET  # of texts from MuJoCo

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mujoco_errors import compile_model

_TOLERANCE = 1e-6
"""Largest difference of a pose, m and unit vectors; MuJoCo writes six digits."""

_Placed = Callable[[mujoco.MjModel, int], dict[str, np.ndarray]]

_POSES = ("body_pos", "body_quat", "geom_pos", "geom_quat", "site_pos", "jnt_pos", "jnt_axis")


def dissolve_frames(document: Document) -> None:
    """Dissolves all frames of a document, in place.

    Raises:
        InputError: MuJoCo cannot compile the document, or a pose would change.
    """
    if not any(element.tag == "frame" for element in document.root.iter()):
        return
    model = compile_model(document.text, document.assets)
    moved: set[ET.Element] = set()
    for world in document.root.findall("worldbody"):
        for parent in [world, *world.iter("body")]:
            _unwrap(parent, moved)
    bodies = [None, *document.bodies()]
    worlds = [child for world in document.root.findall("worldbody") for child in world]
    for body, element in enumerate(bodies):
        if element in moved:
            _write(element, _placed_body(model, body))
        children = worlds if element is None else list(element)
        for tags, placed, ids in _parts(model, body):
            for child, number in zip((c for c in children if c.tag in tags), ids, strict=True):
                if child in moved:
                    _write(child, placed(model, number))
    _check_same(model, compile_model(document.text, document.assets))


def _unwrap(parent: ET.Element, moved: set[ET.Element]) -> None:
    """Replaces each frame among the children by the frame's children, recursively."""
    index = 0
    while index < len(parent):
        frame = parent[index]
        if frame.tag != "frame":
            index += 1
            continue
        for child in frame:
            attribute = "childclass" if child.tag in ("body", "frame") else "class"
            if frame.get("childclass") and not child.get(attribute) and child.tag != "freejoint":
                child.set(attribute, frame.get("childclass", ""))
            moved.add(child)
        parent[index : index + 1] = list(frame)


def _parts(
    model: mujoco.MjModel, body: int
) -> Iterator[tuple[tuple[str, ...], _Placed, list[int]]]:
    """Yields the tags, the poses and the ids of each kind of part of a body."""
    for tags, (owner, placed) in _KINDS.items():
        yield tags, placed, np.flatnonzero(getattr(model, owner) == body).tolist()


def _placed_body(model: mujoco.MjModel, body: int) -> dict[str, np.ndarray]:
    return {"pos": model.body_pos[body], "quat": model.body_quat[body]}


def _placed_geom(model: mujoco.MjModel, geom: int) -> dict[str, np.ndarray]:
    position, orientation = model.geom_pos[geom], model.geom_quat[geom]
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return {"pos": position, "quat": orientation}
    # MuJoCo adds the pose of the mesh in its file to the pose in the text.
    mesh = int(model.geom_dataid[geom])
    inverse, own, shift = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(own, orientation, inverse)
    mujoco.mju_rotVecQuat(shift, model.mesh_pos[mesh], own)
    return {"pos": position - shift, "quat": own}


def _placed_joint(model: mujoco.MjModel, joint: int) -> dict[str, np.ndarray]:
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
        return {}
    return {"pos": model.jnt_pos[joint], "axis": model.jnt_axis[joint]}


def _placed_site(model: mujoco.MjModel, site: int) -> dict[str, np.ndarray]:
    return {"pos": model.site_pos[site], "quat": model.site_quat[site]}


def _placed_camera(model: mujoco.MjModel, camera: int) -> dict[str, np.ndarray]:
    return {"pos": model.cam_pos[camera], "quat": model.cam_quat[camera]}


def _placed_light(model: mujoco.MjModel, light: int) -> dict[str, np.ndarray]:
    return {"pos": model.light_pos[light], "dir": model.light_dir[light]}


_KINDS: Mapping[tuple[str, ...], tuple[str, _Placed]] = MappingProxyType(
    {
        ("geom",): ("geom_bodyid", _placed_geom),
        ("joint", "freejoint"): ("jnt_bodyid", _placed_joint),
        ("site",): ("site_bodyid", _placed_site),
        ("camera",): ("cam_bodyid", _placed_camera),
        ("light",): ("light_bodyid", _placed_light),
    }
)
"""Attribute of the model with the body of each part, and the pose of a part, by its tags."""


def _write(element: ET.Element, placed: dict[str, np.ndarray]) -> None:
    for attribute, values in placed.items():
        element.set(attribute, " ".join(repr(float(value)) for value in values))


def _check_same(before: mujoco.MjModel, after: mujoco.MjModel) -> None:
    for name in _POSES:
        old, new = getattr(before, name), getattr(after, name)
        if old.shape != new.shape or not np.allclose(old, new, atol=_TOLERANCE):
            raise InputError(
                f"the <frame> elements of the MJCF cannot be written out ({name}): write the poses "
                f"of their children by hand"
            )
