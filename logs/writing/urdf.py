"""Conversion of a compiled model to URDF, for viewers of a log.

Links have the names of the frames on ``/tf``. Hinges and slides become joints; a body without a
joint is fixed to its parent. A hinge that does not pass through the origin of its body, or that
shares its body with other hinges, gets an intermediate link without mass. Ground and meshes are
left out; a capsule becomes a cylinder of its length.
"""

import math
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.writing.kinematics import body_names
from selfmodel.robot.robot import Robot

_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
}


def urdf(robot: Robot) -> str:
    """Returns the model of a robot as URDF; the root link is the robot's root body."""
    model = robot.model
    names = ("world", *body_names(model))
    root = model.body(robot.root).id
    tree = ET.Element("robot", name=robot.name)
    kept = {root}
    for body in range(root, model.nbody):
        parent = int(model.body_parentid[body])
        if body != root and parent not in kept:
            continue
        kept.add(body)
        if body != root:
            _joints(tree, model, body, names[parent], names[body])
        _link(tree, model, body, names[body])
    ET.indent(tree)
    return ET.tostring(tree, encoding="unicode")


def _joints(tree: ET.Element, model: mujoco.MjModel, body: int, parent: str, name: str) -> None:
    """Adds the chain of joints and massless links from the parent of a body to the body."""
    first = int(model.body_jntadr[body])
    joints = [
        model.joint(j)
        for j in range(first, first + int(model.body_jntnum[body]))
        if int(model.jnt_type[j]) in _JOINTS
    ]
    offset, turn = model.body_pos[body], model.body_quat[body]
    anchor = np.zeros(3)
    for joint in joints:
        at_end = joint is joints[-1] and not np.any(joint.pos)
        child = name if at_end else f"{name}__{joint.name}"
        if not at_end:
            ET.SubElement(tree, "link", name=child)
        element = _joint(tree, joint.name, _JOINTS[int(joint.type[0])], parent, child)
        # From the second joint on, from one anchor to the next within the body's frame.
        _origin(element, offset + _rotated(joint.pos - anchor, turn), turn)
        ET.SubElement(element, "axis", xyz=_text(joint.axis))
        _limit(element, model, joint.id)
        parent, anchor = child, joint.pos
        offset, turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    if parent != name:
        element = _joint(tree, f"{name}__fixed", "fixed", parent, name)
        _origin(element, offset - anchor, turn)


def _joint(tree: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    element = ET.SubElement(tree, "joint", name=name, type=kind)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    return element


def _limit(element: ET.Element, model: mujoco.MjModel, joint: int) -> None:
    if not model.jnt_limited[joint] and element.get("type") == "revolute":
        element.set("type", "continuous")
        return
    low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-1e3, 1e3)
    # URDF requires an effort and a velocity; viewers ignore both.
    ET.SubElement(
        element, "limit", lower=f"{low:.9g}", upper=f"{high:.9g}", effort="1000", velocity="100"
    )


def _link(tree: ET.Element, model: mujoco.MjModel, body: int, name: str) -> None:
    link = ET.SubElement(tree, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _origin(inertial, model.body_ipos[body], model.body_iquat[body])
    ET.SubElement(inertial, "mass", value=f"{model.body_mass[body]:.9g}")
    xx, yy, zz = (f"{value:.9g}" for value in model.body_inertia[body])
    ET.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        shape = _shape(int(model.geom_type[geom]), model.geom_size[geom])
        if shape is None:
            continue
        visual = ET.SubElement(link, "visual")
        _origin(visual, model.geom_pos[geom], model.geom_quat[geom])
        ET.SubElement(visual, "geometry").append(shape)
        material = ET.SubElement(visual, "material", name=f"{name}_{geom}")
        ET.SubElement(material, "color", rgba=_text(model.geom_rgba[geom]))


def _shape(kind: int, size: FloatArray) -> ET.Element | None:
    radius = f"{size[0]:.9g}"
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return ET.Element("box", size=_text(2 * size))
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return ET.Element("sphere", radius=radius)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return ET.Element("cylinder", radius=radius, length=f"{2 * size[1]:.9g}")
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return ET.Element("cylinder", radius=radius, length=f"{2 * (size[1] + size[0]):.9g}")
    return None


def _origin(element: ET.Element, offset: FloatArray, turn: FloatArray) -> None:
    ET.SubElement(element, "origin", xyz=_text(offset), rpy=_text(_roll_pitch_yaw(turn)))


def _roll_pitch_yaw(quaternion: FloatArray) -> tuple[float, float, float]:
    """Returns URDF's fixed-axis angles of a rotation, rad."""
    w, x, y, z = (float(value) for value in quaternion)
    sine = 2 * (w * y - x * z)
    if abs(sine) > 1 - 1e-9:  # gimbal lock
        return 0.0, math.copysign(math.pi / 2, sine), -math.copysign(2, sine) * math.atan2(x, w)
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def _rotated(vector: FloatArray, quaternion: FloatArray) -> FloatArray:
    result = np.zeros(3)
    mujoco.mju_rotVecQuat(result, vector, quaternion)
    return result


def _text(values: Sequence[float] | FloatArray) -> str:
    return " ".join(f"{value:.9g}" for value in values)
