"""A robot from a URDF in a client of PyBullet, and changes of a URDF: faults and heavier links."""

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

SUBSTEP = 0.001
"""Time step of Bullet's physics and of the servos, s: a gear's oscillation takes 15 of them."""


class Client:
    """A robot from a URDF on the ground, in a client of PyBullet; ``close`` ends it."""

    def __init__(self) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)

    def close(self) -> None:
        """Ends the client; further calls do nothing."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _call(self, function: str, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401  # PyBullet's
        """Calls a function of PyBullet for this client."""
        return getattr(pybullet, function)(*arguments, physicsClientId=self.client, **options)

    def _load(self, urdf: str, hinges: Sequence[str], **dynamics: float) -> None:
        """Loads ground and robot, which may lack hinges; ``dynamics`` are those of its links."""
        self._call("setGravity", 0, 0, -9.81)
        plane = self._call("createCollisionShape", pybullet.GEOM_PLANE)
        self._ground = self._call("createMultiBody", 0, plane)
        # Bullet multiplies the coefficients of the two bodies.
        self._call("changeDynamics", self._ground, -1, lateralFriction=1.0, restitution=1.0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.urdf")
            path.write_text(urdf, encoding="utf-8")
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            self._body = self._call("loadURDF", str(path), flags=flags)
        joints = range(self._call("getNumJoints", self._body))
        infos = [self._call("getJointInfo", self._body, joint) for joint in joints]
        self._links = {info[12].decode(): info[0] for info in infos}
        found = {i[1].decode(): i[0] for i in infos if i[2] == pybullet.JOINT_REVOLUTE}
        self._present = np.array([name in found for name in hinges])
        self._hinges = [found[name] for name in hinges if name in found]
        for link in (-1, *joints):
            self._call("changeDynamics", self._body, link, **dynamics)
        # Each joint of PyBullet begins with a motor that holds it.
        self._control(pybullet.VELOCITY_CONTROL, [0.0] * len(self._hinges))
        self._inertial = self._call("getDynamicsInfo", self._body, -1)[3:5]

    def _control(self, mode: int, forces: list[float]) -> None:
        self._call("setJointMotorControlArray", self._body, self._hinges, mode, forces=forces)

    def _advance(self, torques: np.ndarray) -> None:
        """Advances by a substep under a torque at each present hinge, N m."""
        self._control(pybullet.TORQUE_CONTROL, torques.tolist())
        self._call("stepSimulation")

    def _states(self) -> np.ndarray:
        """Returns angle, rad, and angular velocity, rad/s, of each present hinge."""
        states = self._call("getJointStates", self._body, self._hinges)
        return np.array([state[:2] for state in states]).T

    def base(self) -> tuple[np.ndarray, Rotation, np.ndarray, np.ndarray]:
        """Returns position, m, orientation, velocity, m/s, angular velocity, rad/s, of the base.

        Those of the origin of the root body, where PyBullet's are of its centre of mass; the
        angular velocity is in the frame of the base.
        """
        centre, turn = self._call("getBasePositionAndOrientation", self._body)
        inverse = pybullet.invertTransform(*self._inertial)
        position, quaternion = pybullet.multiplyTransforms(centre, turn, *inverse)
        linear, angular = map(np.array, self._call("getBaseVelocity", self._body))
        orientation = Rotation.from_quat(quaternion)
        linear = linear + np.cross(angular, np.subtract(position, centre))
        return np.array(position), orientation, linear, orientation.inv().apply(angular)


def with_faults(tree: ET.Element, lost: Iterable[str], fixed: Mapping[str, float]) -> str:
    """Returns a URDF less joints and the links that they move, with joints fixed at angles, rad."""
    joints = {joint.get("name"): joint for joint in tree.findall("joint")}
    links = {link.get("name"): link for link in tree.findall("link")}
    for name in lost:
        tree.remove(links[part(joints[name], "child").get("link")])
        tree.remove(joints[name])
    for name, angle in fixed.items():
        _fix(joints[name], angle)
    return ET.tostring(tree, encoding="unicode")


def _fix(joint: ET.Element, angle: float) -> None:
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


def _numbers(element: ET.Element, name: str) -> np.ndarray:
    return np.array([float(value) for value in element.get(name, "").split()])
