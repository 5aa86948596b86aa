"""Writes the bodies of MuJoCo's importer of URDF as MJCF, exact to the last bit.

``MjSpec.to_xml`` writes numbers of six digits, which would move the feet of a robot.
"""

from collections.abc import Collection, Sequence
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.work import format_numbers

Frame = tuple[FloatArray, FloatArray]
"""Position, ``(3,)`` m, and orientation, ``(4,)`` w x y z, in another frame."""

NO_FRAME: Frame = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
"""The frame that is the outer frame."""

_GEOMS = {
    mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", 1),
    mujoco.mjtGeom.mjGEOM_CAPSULE: ("capsule", 2),
    mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", 2),
    mujoco.mjtGeom.mjGEOM_BOX: ("box", 3),
    mujoco.mjtGeom.mjGEOM_MESH: ("mesh", 0),
}
"""Name and number of sizes of the geoms of a URDF."""

_VISUAL_GROUP, _HIDDEN_GROUP = "2", "3"
"""Groups of visuals, and of collisions of a link with visuals, as in MuJoCo's Menagerie."""


def mesh_elements(spec: mujoco.MjSpec) -> list[ET.Element]:
    """Returns the meshes of a specification as MJCF."""
    # With the inertia of a shell, MuJoCo accepts flat and open meshes; masses are not from meshes.
    return [
        ET.Element(
            "mesh",
            {"name": m.name, "file": m.file, "scale": format_numbers(m.scale), "inertia": "shell"},
        )
        for m in spec.meshes
    ]


def world_elements(spec: mujoco.MjSpec) -> list[ET.Element]:
    """Returns the geoms and the bodies of the world as MJCF, the bodies with their descendants.

    A link without mass and geoms that moves and has one child becomes a further hinge of that
    child, because MuJoCo moves no massless body. The geoms of a link that is fixed to a part in the
    middle of a limb are given to that part, so that only the ends of limbs, such as feet, are
    bodies with geoms and without children.
    """
    middle = {_main(body.parent).name for body in spec.bodies if body.joints and body.parent}
    geoms = [_geom(geom, NO_FRAME, seen=False) for geom in spec.worldbody.geoms]
    roots = [_written(body, NO_FRAME, [], None, middle) for body in spec.worldbody.bodies]
    return [*geoms, *roots]


def _main(body: mujoco.MjsBody) -> mujoco.MjsBody:
    """Returns the body with joints, or the root, that a body is fixed to."""
    while not body.joints and body.parent is not None and body.parent.parent is not None:
        body = body.parent
    return body


def _written(
    body: mujoco.MjsBody,
    outer: Frame,
    hinges: Sequence[tuple[mujoco.MjsJoint, Frame]],
    main: tuple[ET.Element, Frame, bool] | None,
    middle: Collection[str],
) -> ET.Element:
    """Returns a body with its descendants as MJCF.

    Args:
        body: The body.
        outer: Frame of the body's parent in the parent element.
        hinges: Hinges of the massless parents, and the frames of their bodies in the parent's.
        main: The element of the body with hinges, or of the root, that the parent is fixed to; the
            parent's frame in it; whether another body hangs on it. None for a root.
        middle: Names of the bodies on which another body hangs by a hinge.
    """
    own = np.array(body.pos), np.array(body.quat)
    frame, inner = _joined(outer, own), _inverse(own)
    here = [(joint, _joined(inner, place)) for joint, place in hinges]
    here += [(joint, NO_FRAME) for joint in body.joints]
    if here and not body.mass and not len(body.geoms) and len(body.bodies) == 1:
        return _written(body.bodies[0], frame, here, main, middle)
    element = ET.Element("body", {"name": body.name} | _place(frame))
    if body.mass:
        ET.SubElement(element, "inertial", _inertial(body))
    element.extend([_joint(*hinge) for hinge in here])
    if here or main is None:
        main = element, NO_FRAME, body.name in middle
    else:
        main = main[0], _joined(main[1], frame), main[2]
    carrier, at = main[:2] if main[2] else (element, NO_FRAME)
    seen = any(not geom.contype for geom in body.geoms)
    carrier.extend([_geom(geom, at, seen=seen) for geom in body.geoms])
    element.extend([_written(child, NO_FRAME, [], main, middle) for child in body.bodies])
    return element


def _joined(outer: Frame, inner: Frame) -> Frame:
    """Returns a frame that is given in a frame, in the outer frame of that frame."""
    orientation = np.empty(4)
    mujoco.mju_mulQuat(orientation, outer[1], inner[1])
    return outer[0] + _turned(inner[0], outer[1]), orientation


def _inverse(frame: Frame) -> Frame:
    orientation = np.empty(4)
    mujoco.mju_negQuat(orientation, frame[1])
    return _turned(-frame[0], orientation), orientation


def _turned(vector: FloatArray, orientation: FloatArray) -> FloatArray:
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, np.asarray(vector, float), orientation)
    return turned


def _place(frame: Frame) -> dict[str, str]:
    return {"pos": format_numbers(frame[0]), "quat": format_numbers(frame[1])}


def _inertial(body: mujoco.MjsBody) -> dict[str, str]:
    place = np.array(body.ipos), np.array(body.iquat)
    mass = {"mass": repr(float(body.mass))}
    moments = _moments(body)
    if not is_rigid(body):
        moments = np.array([*np.full(3, max(0.0, float(moments[:3].mean()))), 0.0, 0.0, 0.0])
    if not np.any(moments[3:]):
        return _place(place) | mass | {"diaginertia": format_numbers(moments[:3])}
    # MJCF has no orientation beside a full inertia.
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, place[1])
    turn = rotation.reshape(3, 3)
    matrix = turn @ _inertia_matrix(body) @ turn.T
    full = matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return {"pos": format_numbers(place[0]), "fullinertia": format_numbers(full)} | mass


def is_rigid(body: mujoco.MjsBody) -> bool:
    """Returns whether the inertia of a body is that of a rigid body, or zero."""
    matrix = _inertia_matrix(body)
    if not np.any(matrix):
        return True
    least, middle, most = np.linalg.eigvalsh(matrix)
    return bool(least > 0 and least + middle >= most)


def _inertia_matrix(body: mujoco.MjsBody) -> FloatArray:
    """Returns the inertia of a body in its inertial frame, ``(3, 3)`` kg m²."""
    xx, yy, zz, xy, xz, yz = _moments(body)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _moments(body: mujoco.MjsBody) -> FloatArray:
    """Returns the moments and products of inertia, ``(6,)`` kg m²; 0 if the URDF has none."""
    moments: FloatArray = np.nan_to_num(np.array(body.fullinertia, float))
    return moments


def _joint(joint: mujoco.MjsJoint, frame: Frame) -> ET.Element:
    attributes = {
        "name": joint.name,
        "type": "hinge",
        "pos": format_numbers(frame[0]),
        "axis": format_numbers(_turned(joint.axis, frame[1])),
    }
    if joint.range[0] < joint.range[1]:
        attributes |= {"range": format_numbers(joint.range), "limited": "true"}
    for name, value in (("damping", joint.damping[0]), ("frictionloss", joint.frictionloss)):
        if value:
            attributes[name] = repr(float(value))
    return ET.Element("joint", attributes)


def _geom(geom: mujoco.MjsGeom, frame: Frame, *, seen: bool) -> ET.Element:
    """Returns a geom as MJCF, in an element in which its body has a frame.

    If the link is ``seen``, by its visuals, its collisions are not drawn.
    """
    kind, sizes = _GEOMS[geom.type]
    place = _joined(frame, (np.array(geom.pos), np.array(geom.quat)))
    attributes = {"type": kind} | _place(place)
    if sizes:
        attributes["size"] = format_numbers(geom.size[:sizes])
    else:
        attributes["mesh"] = geom.meshname
    attributes["rgba"] = format_numbers(np.array(geom.rgba, float))
    if not geom.contype:
        attributes |= {"contype": "0", "conaffinity": "0", "group": _VISUAL_GROUP}
    elif seen:
        attributes["group"] = _HIDDEN_GROUP
    return ET.Element("geom", attributes)
