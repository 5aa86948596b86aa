"""A damaged robot on the ground in a client of PyBullet, and its URDF."""

from collections.abc import Mapping
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.client import SUBSTEP, Client, scale, with_faults
from benchmarks.other_engine.reality import Damage, Reality
from selfmodel.errors import InputError
from selfmodel.logs.viewers import urdf as exported_urdf
from selfmodel.robot.robot import Robot

FOOT_TOLERANCE = 1.2
"""Largest distance of a contact that a foot senses from the centre of its site, in its radii."""

MASSLESS = "1e-09"
"""Mass, kg, and inertia, kg m^2, of the links between two hinges of one body; PyBullet gives a link
without an inertia a mass of 1 kg."""


class Contact(NamedTuple):
    """A contact of the robot with the ground: m, N; the depth is negative for a gap."""

    link: int
    position: np.ndarray
    depth: float
    force: float


class Bullet(Client):
    """A damaged robot in a client of PyBullet, by the names of its model.

    Its URDF is that of the model, damaged, unless another is given, which is damaged already.
    """

    def __init__(
        self,
        robot: Robot,
        reality: Reality,
        damage: Damage,
        urdf: str = "",
        timestep: float = SUBSTEP,
    ) -> None:
        super().__init__()
        self._robot, self._reality, self._damage = robot, reality, damage
        self._urdf, self.timestep = urdf or damaged_urdf(robot, reality, damage), timestep
        model = robot.model
        self._sites = {
            sensor.name: int(model.sensor_objid[model.sensor(sensor.name).id])
            for sensor in robot.anatomy.sensors
            if sensor.kind == "touch"
        }
        self.reset()

    def reset(self) -> None:
        """Loads ground and robot anew, in the initial pose at rest: no contact is remembered."""
        self._call("resetSimulation")
        self._call(
            "setPhysicsEngineParameter",
            fixedTimeStep=self.timestep,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            enableFileCaching=0,
        )
        undamped = dict.fromkeys(("linearDamping", "angularDamping", "jointDamping"), 0.0)
        self._load(
            self._urdf,
            self._robot.anatomy.hinges,
            **undamped,
            lateralFriction=self._reality.friction,
            restitution=self._reality.restitution,
        )
        root = self._robot.model.body(self._robot.root)
        self.place(root.pos, root.quat, np.zeros(len(self._present)))

    def place(self, position: np.ndarray, orientation: np.ndarray, angles: np.ndarray) -> None:
        """Moves the robot to a pose of its root, w x y z, and all hinges, rad, at rest."""
        pose = pybullet.multiplyTransforms(position, np.roll(orientation, -1), *self._inertial)
        self._call("resetBasePositionAndOrientation", self._body, *pose)
        self._call("resetBaseVelocity", self._body, [0, 0, 0], [0, 0, 0])
        for joint, angle in zip(self._hinges, angles[self._present], strict=True):
            self._call("resetJointState", self._body, joint, angle, 0.0)
        self._call("performCollisionDetection")

    def depth(self) -> float:
        """Returns the depth of the deepest contact with the ground, m; 0 without one."""
        return max([0.0, *(contact.depth for contact in self._contacts())])

    def step(self, torques: np.ndarray) -> None:
        """Advances by a substep under a torque at each hinge of the model, N m.

        Those of absent and fixed hinges have no effect.
        """
        self._advance(torques[self._present])

    def follow(self, targets: np.ndarray, efforts: np.ndarray, motor: Mapping[str, float]) -> None:
        """Advances by a substep under Bullet's own motors, of targets, rad, and efforts, N m.

        Both are of each hinge of the model; ``motor`` has what all motors share.
        """
        own = targets[self._present], efforts[self._present]
        for joint, target, effort in zip(self._hinges, *own, strict=True):
            drive = {"controlMode": pybullet.POSITION_CONTROL, "targetPosition": target, **motor}
            self._call("setJointMotorControl2", self._body, joint, force=effort, **drive)
        self._call("stepSimulation")

    def hinges(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns angle, rad, and angular velocity, rad/s, of each hinge of the model.

        An absent hinge has the angle 0, a fixed one its angle; both have the velocity 0.
        """
        names = self._robot.anatomy.hinges
        angles = np.array([self._damage.fixed.get(name, 0.0) for name in names])
        speeds = np.zeros(len(names))
        angles[self._present], speeds[self._present] = self._states()
        return angles, speeds

    def is_valid(self) -> bool:
        """Returns whether the state is finite: Bullet has no warning of its own."""
        centre, turn = self._call("getBasePositionAndOrientation", self._body)
        numbers = np.concatenate([centre, *self.hinges()])
        return bool(np.isfinite(numbers).all() and np.linalg.norm(turn) > 0.5)

    def touches(self) -> dict[str, bool]:
        """Returns whether each touch sensor senses the ground."""
        by_link: dict[int, list[np.ndarray]] = {}
        for contact in self._contacts():
            if contact.force > 0 or contact.depth >= 0:  # there is no force before the first step
                by_link.setdefault(contact.link, []).append(contact.position)
        model, felt = self._robot.model, dict.fromkeys(self._sites, False)
        for name, site in self._sites.items():
            link = self._links.get(model.body(model.site_bodyid[site]).name)
            if link in by_link:
                pose, place = self._pose(link), (model.site_pos[site], [0, 0, 0, 1])
                foot, _ = pybullet.multiplyTransforms(*pose, *place)
                reach = FOOT_TOLERANCE * float(model.site_size[site, 0])
                felt[name] = any(np.linalg.norm(at - foot) <= reach for at in by_link[link])
        return felt

    def _pose(self, link: int) -> tuple[Any, Any]:
        state = self._call("getLinkState", self._body, link, computeForwardKinematics=1)
        return state[4], state[5]

    def positions(self) -> dict[str, np.ndarray]:
        """Returns the position of each present body other than the root, m."""
        return {name: np.array(self._pose(link)[0]) for name, link in self._links.items()}

    def mass(self) -> float:
        """Returns the total mass, kg."""
        links = (-1, *self._links.values())
        return float(sum(self._call("getDynamicsInfo", self._body, link)[0] for link in links))

    def _contacts(self) -> list[Contact]:
        found = self._call("getContactPoints", self._body, self._ground)
        return [Contact(point[3], np.array(point[5]), -point[8], point[9]) for point in found]


def damaged_urdf(robot: Robot, reality: Reality, damage: Damage) -> str:
    """Returns selfmodel's URDF with collision shapes and other masses, and without lost links."""
    # The export is selfmodel's own text, so no untrusted XML is parsed.
    tree = ET.fromstring(exported_urdf(robot))  # noqa: S314  # see the line above
    for link in tree.findall("link"):
        _complete(link, robot.model, reality)
    return with_faults(tree, damage.lost, damage.fixed)


def _complete(link: ET.Element, model: mujoco.MjModel, reality: Reality) -> None:
    """Replaces the shapes of a viewer by collision shapes, and scales the mass."""
    for visual in link.findall("visual"):
        link.remove(visual)
    inertial = link.find("inertial")
    if inertial is None:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "mass", value=MASSLESS)
        axes = dict.fromkeys(("ixx", "iyy", "izz"), MASSLESS)
        ET.SubElement(inertial, "inertia", axes, ixy="0", ixz="0", iyz="0")
        return
    body = model.body(link.get("name")).id
    scale(link, reality.masses[body])
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            _add_collision(link, model, geom)


def _add_collision(link: ET.Element, model: mujoco.MjModel, geom: int) -> None:
    """Adds a shape that includes the margin: the soft skin in which contact forces begin."""
    size = model.geom_size[geom] + model.geom_margin[geom]
    match int(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_BOX:
            shape = ET.Element("box", size=_text(2 * size))
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            length = repr(2 * float(model.geom_size[geom][1]))
            shape = ET.Element("capsule", radius=repr(float(size[0])), length=length)
        case kind:
            raise InputError(
                f"expected collision shapes that are boxes or capsules, as those of our robots "
                f"are, got {mujoco.mjtGeom(kind).name}: add its URDF shape here"
            )
    collision = ET.SubElement(link, "collision")
    turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True).as_euler("xyz")
    ET.SubElement(collision, "origin", xyz=_text(model.geom_pos[geom]), rpy=_text(turn))
    ET.SubElement(collision, "geometry").append(shape)


def _text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
