"""The URDF of a damaged robot: selfmodel's export, with collision shapes and without lost links."""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.damage import Damage
from benchmarks.other_engine.reality import Reality
from selfmodel.errors import InputError
from selfmodel.logs.viewers import urdf as exported_urdf
from selfmodel.robot.robot import Robot

MASSLESS = 1e-9
"""Mass, kg, and inertia, kg m^2, of the links between two hinges of one body; PyBullet gives a link
without an inertia a mass of 1 kg."""


def damaged_urdf(robot: Robot, reality: Reality, damage: Damage) -> str:
    """Returns the robot as URDF, for PyBullet.

    Args:
        robot: The healthy robot.
        reality: The factors of the masses.
        damage: Hinges to remove with their links, and to fix.
    """
    # The export is selfmodel's own text, so no untrusted XML is parsed.
    tree = ET.fromstring(exported_urdf(robot))  # noqa: S314  # see the line above
    for link in tree.findall("link"):
        _complete(link, robot.model, reality)
    joints = {joint.get("name"): joint for joint in tree.findall("joint")}
    for hinge in damage.lost:
        _remove(tree, joints[hinge])
    for hinge, angle in damage.fixed.items():
        _fix(joints[hinge], angle)
    return ET.tostring(tree, encoding="unicode")


def _complete(link: ET.Element, model: mujoco.MjModel, reality: Reality) -> None:
    """Replaces the shapes of a viewer by collision shapes, and scales the mass."""
    for visual in link.findall("visual"):
        link.remove(visual)
    inertial = link.find("inertial")
    if inertial is None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "mass", value=str(MASSLESS))
        axes = dict.fromkeys(("ixx", "iyy", "izz"), str(MASSLESS))
        ET.SubElement(inertial, "inertia", axes, ixy="0", ixz="0", iyz="0")
        return
    body = model.body(link.get("name")).id
    for element in inertial.findall("mass") + inertial.findall("inertia"):
        for name, value in element.attrib.items():
            element.set(name, repr(float(value) * reality.masses[body]))
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            _add_collision(link, model, geom)


def _add_collision(link: ET.Element, model: mujoco.MjModel, geom: int) -> None:
    """Adds a shape that includes the margin: the soft skin in which contact forces begin."""
    size = model.geom_size[geom] + model.geom_margin[geom]
    kind = int(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        shape = ET.Element("box", size=_text(2 * size))
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        length = 2 * float(model.geom_size[geom][1])
        shape = ET.Element("capsule", radius=repr(float(size[0])), length=repr(length))
    else:
        raise InputError(
            f"expected collision shapes that are boxes or capsules, as those of our robots are, "
            f"got {mujoco.mjtGeom(kind).name}: add its URDF shape here"
        )
    collision = ET.SubElement(link, "collision")
    turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
    ET.SubElement(
        collision, "origin", xyz=_text(model.geom_pos[geom]), rpy=_text(turn.as_euler("xyz"))
    )
    ET.SubElement(collision, "geometry").append(shape)


def _remove(tree: ET.Element, joint: ET.Element) -> None:
    """Removes a joint and its child link."""
    child = joint.find("child")
    name = None if child is None else child.get("link")
    for link in tree.findall("link"):
        if link.get("name") == name:
            tree.remove(link)
    tree.remove(joint)


def _fix(joint: ET.Element, angle: float) -> None:
    """Makes a hinge a fixed joint at an angle, rad."""
    origin, axis = joint.find("origin"), joint.find("axis")
    if origin is None or axis is None:
        raise ValueError(f"the hinge {joint.get('name')} has no origin or no axis")
    turn = Rotation.from_euler("xyz", _numbers(origin, "rpy"))  # URDF's are about fixed axes
    turn *= Rotation.from_rotvec(angle * _numbers(axis, "xyz"))
    origin.set("rpy", _text(turn.as_euler("xyz")))
    joint.set("type", "fixed")
    for name in ("axis", "limit"):
        for element in joint.findall(name):
            joint.remove(element)


def _numbers(element: ET.Element, name: str) -> np.ndarray:
    return np.array([float(value) for value in element.get(name, "").split()])


def _text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
