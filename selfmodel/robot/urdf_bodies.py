"""Writes the bodies of MuJoCo's importer of URDF as MJCF, exact to the last bit.

``MjSpec.to_xml`` writes numbers of six digits, which would move the feet of a robot.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.document import format_numbers


@dataclass(frozen=True)
class Frame:
    """A frame in another frame.

    Attributes:
        position: ``(3,)``, m.
        orientation: ``(4,)``, unit quaternion.
    """

    position: FloatArray
    orientation: FloatArray

    def then(self, inner: "Frame") -> "Frame":
        """Returns a frame that is given in this frame, in the outer frame."""
        position, orientation = np.empty(3), np.empty(4)
        mujoco.mju_rotVecQuat(position, inner.position, self.orientation)
        mujoco.mju_mulQuat(orientation, self.orientation, inner.orientation)
        return Frame(self.position + position, orientation)

    def inverse(self) -> "Frame":
        """Returns the outer frame in this frame."""
        position, orientation = np.empty(3), np.empty(4)
        mujoco.mju_negQuat(orientation, self.orientation)
        mujoco.mju_rotVecQuat(position, -self.position, orientation)
        return Frame(position, orientation)

    def direction(self, vector: FloatArray) -> FloatArray:
        """Returns a vector that is given in this frame, in the outer frame."""
        result = np.empty(3)
        mujoco.mju_rotVecQuat(result, np.asarray(vector, float), self.orientation)
        return result


NO_FRAME = Frame(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
"""The frame that is the outer frame."""


def placed(frame: Frame) -> dict[str, str]:
    """Returns the attributes of MJCF for the place of an element."""
    return {"pos": format_numbers(frame.position), "quat": format_numbers(frame.orientation)}


def inertial(body: mujoco.MjsBody) -> dict[str, str]:
    """Returns the attributes of an ``<inertial>``."""
    mass = {"mass": repr(float(body.mass))}
    full = _moments(body)
    if not is_rigid(body):
        full = np.array([*np.full(3, max(0.0, float(full[:3].mean()))), 0.0, 0.0, 0.0])
    if not np.any(full[3:]):
        frame = Frame(np.array(body.ipos), np.array(body.iquat))
        return placed(frame) | mass | {"diaginertia": format_numbers(full[:3])}
    # MJCF has no orientation beside a full inertia.
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(body.iquat))
    turn = rotation.reshape(3, 3)
    matrix = turn @ _inertia_matrix(body) @ turn.T
    elements = matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return {
        "pos": format_numbers(np.array(body.ipos)),
        "fullinertia": format_numbers(elements),
    } | mass


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


@dataclass(frozen=True, eq=False)
class _Hinge:
    """A hinge of a massless link, in the frame of the link that it is merged into."""

    joint: mujoco.MjsJoint
    frame: Frame


@dataclass(frozen=True, eq=False)
class _Main:
    """The element of a body with hinges, or of the root, and what is fixed to it.

    Attributes:
        element: The ``<body>``.
        frame: Frame of a body that is fixed to it, in its frame.
        in_middle: Whether another body hangs on it by a hinge.
    """

    element: ET.Element
    frame: Frame
    in_middle: bool


def world_elements(spec: mujoco.MjSpec) -> list[ET.Element]:
    """Returns the geoms and the bodies of the world as MJCF, the bodies with their descendants.

    A link without mass and geoms that moves and has one child becomes a further hinge of that
    child, because MuJoCo moves no massless body. The geoms of a link that is fixed to a part in the
    middle of a limb are given to that part, so that only the ends of limbs, such as feet, are
    bodies with geoms and without children.
    """
    middle: set[str] = set()
    for body in spec.bodies:
        if body.joints and body.parent is not None:
            middle.add(_main(body.parent).name)
    roots = [_written(body, NO_FRAME, [], None, middle) for body in spec.worldbody.bodies]
    return [*(_geom(geom, NO_FRAME, seen=False) for geom in spec.worldbody.geoms), *roots]


def _main(body: mujoco.MjsBody) -> mujoco.MjsBody:
    """Returns the body with joints, or the root, that a body is fixed to."""
    while not body.joints and body.parent is not None and body.parent.parent is not None:
        body = body.parent
    return body


def meshes(spec: mujoco.MjSpec) -> list[ET.Element]:
    """Returns the meshes of a specification as MJCF."""
    # With the inertia of a shell, MuJoCo accepts flat and open meshes; masses are not from meshes.
    return [
        ET.Element(
            "mesh",
            {
                "name": mesh.name,
                "file": mesh.file,
                "scale": format_numbers(mesh.scale),
                "inertia": "shell",
            },
        )
        for mesh in spec.meshes
    ]


def _written(
    body: mujoco.MjsBody,
    outer: Frame,
    hinges: list[_Hinge],
    main: _Main | None,
    middle: Collection[str],
) -> ET.Element:
    """Returns a body with its descendants as MJCF.

    Args:
        body: The body.
        outer: Frame of the body's parent in the parent element.
        hinges: Hinges of the massless parents, in the frame of the body's parent.
        main: The element that the body's parent is fixed to; None for a root.
        middle: Names of the bodies in the middle of limbs.
    """
    own = Frame(np.array(body.pos), np.array(body.quat))
    frame, inner = outer.then(own), own.inverse()
    own_hinges = [_Hinge(joint, NO_FRAME) for joint in body.joints]
    here = [_Hinge(hinge.joint, inner.then(hinge.frame)) for hinge in hinges] + own_hinges
    if here and not body.mass and not len(body.geoms) and len(body.bodies) == 1:
        return _written(body.bodies[0], frame, here, main, middle)
    element = ET.Element("body", {"name": body.name} | placed(frame))
    if body.mass:
        ET.SubElement(element, "inertial", inertial(body))
    element.extend([_joint(hinge) for hinge in here])
    if here or main is None:
        main = _Main(element, NO_FRAME, in_middle=body.name in middle)
    else:
        main = replace(main, frame=main.frame.then(frame))
    seen = any(not geom.contype for geom in body.geoms)
    at = main if main.in_middle else _Main(element, NO_FRAME, in_middle=False)
    for geom in body.geoms:
        at.element.append(_geom(geom, at.frame, seen=seen))
    element.extend([_written(child, NO_FRAME, [], main, middle) for child in body.bodies])
    return element


def _joint(hinge: _Hinge) -> ET.Element:
    joint, frame = hinge.joint, hinge.frame
    attributes = {
        "name": joint.name,
        "type": "hinge",
        "pos": format_numbers(frame.position),
        "axis": format_numbers(frame.direction(joint.axis)),
    }
    if joint.range[0] < joint.range[1]:
        attributes |= {"range": format_numbers(joint.range), "limited": "true"}
    for name, value in (("damping", joint.damping[0]), ("frictionloss", joint.frictionloss)):
        if value:
            attributes[name] = repr(float(value))
    return ET.Element("joint", attributes)


def _geom(geom: mujoco.MjsGeom, frame: Frame, *, seen: bool) -> ET.Element:
    """Returns a geom as MJCF.

    Args:
        geom: The geom.
        frame: Frame of its body in the element that gets the geom.
        seen: Whether the link has visuals, so that its collisions are not drawn.
    """
    kind, sizes = _GEOMS[geom.type]
    attributes = {"type": kind} | placed(frame.then(Frame(np.array(geom.pos), np.array(geom.quat))))
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
