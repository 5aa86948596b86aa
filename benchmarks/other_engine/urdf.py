"""Changes of a URDF, a locked joint and a heavier link, and the motion of its root in PyBullet."""

from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation


def fix(joint: ET.Element, angle: float) -> None:
    """Makes a hinge a fixed joint at an angle, rad."""
    origin, axis = part(joint, "origin"), part(joint, "axis")
    turn = Rotation.from_euler("xyz", _numbers(origin, "rpy"))  # URDF's are about fixed axes
    turn *= Rotation.from_rotvec(angle * _numbers(axis, "xyz"))
    origin.set("rpy", " ".join(repr(float(value)) for value in turn.as_euler("xyz")))
    joint.set("type", "fixed")
    for element in joint.findall("axis") + joint.findall("limit"):
        joint.remove(element)


def scale(link: ET.Element, factor: float) -> None:
    """Multiplies mass and inertia of a link."""
    inertial = part(link, "inertial")
    for element in inertial.findall("mass") + inertial.findall("inertia"):
        for name, value in element.attrib.items():
            element.set(name, repr(float(value) * factor))


def part(element: ET.Element, name: str) -> ET.Element:
    """Returns the first child of a name."""
    found = element.find(name)
    if found is None:
        raise ValueError(f"{element.get('name')} has no {name}")
    return found


def root_motion(
    pose: Sequence[Sequence[float]],
    twist: Sequence[Sequence[float]],
    inertial: Sequence[Sequence[float]],
) -> tuple[np.ndarray, Rotation, np.ndarray, np.ndarray]:
    """Returns position, m, orientation, velocity, m/s, angular velocity, rad/s, of a root body.

    PyBullet's pose and twist are those of the centre of mass, at ``inertial`` in the body. Those
    returned are of the origin of the body; the angular velocity is in its frame.
    """
    inverse = pybullet.invertTransform(*inertial)
    position, quaternion = pybullet.multiplyTransforms(*pose, *inverse)
    linear, angular = map(np.array, twist)
    orientation = Rotation.from_quat(quaternion)
    linear = linear + np.cross(angular, np.subtract(position, pose[0]))
    return np.array(position), orientation, linear, orientation.inv().apply(angular)


def _numbers(element: ET.Element, name: str) -> np.ndarray:
    return np.array([float(value) for value in element.get(name, "").split()])
