"""A damaged robot on the ground in a client of PyBullet."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from benchmarks.other_engine.damage import Damage
from benchmarks.other_engine.reality import SUBSTEP, Reality
from benchmarks.other_engine.urdf import damaged_urdf
from selfmodel.robot.robot import Robot

FOOT_TOLERANCE = 1.2
"""Largest distance of a contact that a foot senses from the centre of its site, in its radii."""


@dataclass(frozen=True, eq=False)
class _Contact:
    """A contact of the robot with the ground.

    Attributes:
        link: PyBullet's index of the link.
        position: On the link, world frame, m.
        depth: Depth of the penetration, m; negative for a gap.
        force: Normal force, N.
    """

    link: int
    position: np.ndarray
    depth: float
    force: float


class Bullet:
    """A robot in PyBullet, by the names of its model; ``close`` ends the client.

    Args:
        robot: The healthy robot.
        reality: Masses and contacts of this robot.
        damage: Its damage.

    Attributes:
        client: PyBullet's number of the client; -1 after ``close``.
    """

    def __init__(self, robot: Robot, reality: Reality, damage: Damage) -> None:
        self._robot, self._reality, self._damage = robot, reality, damage
        self._urdf = damaged_urdf(robot, reality, damage)
        model = robot.model
        self._sites = {
            sensor.name: int(model.sensor_objid[model.sensor(sensor.name).id])
            for sensor in robot.anatomy.sensors
            if sensor.kind == "touch"
        }
        self.client = pybullet.connect(pybullet.DIRECT)
        self.reset()

    def close(self) -> None:
        """Ends the client; further calls do nothing."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def reset(self) -> None:
        """Loads ground and robot anew, in the initial pose at rest: no contact is remembered."""
        client = {"physicsClientId": self.client}
        pybullet.resetSimulation(**client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=SUBSTEP, numSubSteps=0, deterministicOverlappingPairs=1,
            enableFileCaching=0, **client,
        )  # fmt: skip
        pybullet.setGravity(*self._robot.model.opt.gravity, **client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **client)
        self._ground = pybullet.createMultiBody(0, plane, **client)
        self._load()
        self._set_dynamics()
        root = self._robot.model.body(self._robot.root)
        self.place(root.pos, root.quat, np.zeros(len(self._present)))

    def _load(self) -> None:
        """Loads the URDF, and finds its links and hinges by name."""
        client = {"physicsClientId": self.client}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.urdf")
            path.write_text(self._urdf, encoding="utf-8")
            self._body = pybullet.loadURDF(
                str(path), flags=pybullet.URDF_USE_INERTIA_FROM_FILE, **client
            )
        count = pybullet.getNumJoints(self._body, **client)
        infos = [pybullet.getJointInfo(self._body, k, **client) for k in range(count)]
        self._links = {info[12].decode(): info[0] for info in infos}
        hinges = {i[1].decode(): i[0] for i in infos if i[2] == pybullet.JOINT_REVOLUTE}
        names = self._robot.anatomy.hinges
        self._present = np.array([name in hinges for name in names])
        self._hinges = [hinges[name] for name in names if name in hinges]

    def _set_dynamics(self) -> None:
        client = {"physicsClientId": self.client}
        # Bullet multiplies the coefficients of the two bodies.
        pybullet.changeDynamics(self._ground, -1, lateralFriction=1.0, restitution=1.0, **client)
        for link in (-1, *self._links.values()):
            pybullet.changeDynamics(
                self._body, link,
                lateralFriction=self._reality.friction, restitution=self._reality.restitution,
                linearDamping=0, angularDamping=0, jointDamping=0, **client,
            )  # fmt: skip
        # Each joint of PyBullet begins with a motor that holds it.
        pybullet.setJointMotorControlArray(
            self._body, self._hinges, pybullet.VELOCITY_CONTROL,
            forces=[0.0] * len(self._hinges), **client,
        )  # fmt: skip
        found = pybullet.getDynamicsInfo(self._body, -1, **client)
        self._base_inertial = found[3], found[4]

    def place(self, position: np.ndarray, orientation: np.ndarray, angles: np.ndarray) -> None:
        """Moves the robot to a pose, at rest.

        Args:
            position: Position of the root body, m.
            orientation: Its orientation, w x y z.
            angles: Angle of each hinge of the model, rad; unused for absent and fixed ones.
        """
        client = {"physicsClientId": self.client}
        pose = pybullet.multiplyTransforms(position, np.roll(orientation, -1), *self._base_inertial)
        pybullet.resetBasePositionAndOrientation(self._body, *pose, **client)
        pybullet.resetBaseVelocity(self._body, [0, 0, 0], [0, 0, 0], **client)
        for joint, angle in zip(self._hinges, angles[self._present], strict=True):
            pybullet.resetJointState(self._body, joint, angle, 0.0, **client)
        pybullet.performCollisionDetection(**client)

    def depth(self) -> float:
        """Returns the depth of the deepest contact with the ground, m; 0 without one."""
        return max([0.0, *(contact.depth for contact in self._contacts())])

    def step(self, torques: np.ndarray) -> None:
        """Advances by a substep.

        Args:
            torques: Torque at each hinge of the model, N m; those of absent and fixed ones have no
                effect.
        """
        pybullet.setJointMotorControlArray(
            self._body, self._hinges, pybullet.TORQUE_CONTROL,
            forces=torques[self._present].tolist(), physicsClientId=self.client,
        )  # fmt: skip
        pybullet.stepSimulation(physicsClientId=self.client)

    def hinges(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns angle, rad, and angular velocity, rad/s, of each hinge of the model.

        An absent hinge has the angle 0, a fixed one its angle; both have the velocity 0.
        """
        names = self._robot.anatomy.hinges
        angles = np.array([self._damage.fixed.get(name, 0.0) for name in names])
        speeds = np.zeros(len(names))
        states = pybullet.getJointStates(self._body, self._hinges, physicsClientId=self.client)
        angles[self._present] = [state[0] for state in states]
        speeds[self._present] = [state[1] for state in states]
        return angles, speeds

    def base(self) -> tuple[np.ndarray, Rotation, np.ndarray, np.ndarray]:
        """Returns position, m, orientation, velocity, m/s, angular velocity, rad/s, of the base.

        Those of the origin of the root body; the angular velocity is in the frame of the base.
        """
        client = {"physicsClientId": self.client}
        centre, turn = pybullet.getBasePositionAndOrientation(self._body, **client)
        inverse = pybullet.invertTransform(*self._base_inertial)
        position, quaternion = pybullet.multiplyTransforms(centre, turn, *inverse)
        linear, angular = map(np.array, pybullet.getBaseVelocity(self._body, **client))
        orientation = Rotation.from_quat(quaternion)
        linear = linear + np.cross(angular, np.subtract(position, centre))
        return np.array(position), orientation, linear, orientation.inv().apply(angular)

    def is_valid(self) -> bool:
        """Returns whether the state is finite: Bullet has no warning of its own."""
        centre, turn = pybullet.getBasePositionAndOrientation(
            self._body, physicsClientId=self.client
        )
        numbers = np.concatenate([centre, *self.hinges()])
        return bool(np.isfinite(numbers).all() and np.linalg.norm(turn) > 0.5)

    def touches(self) -> dict[str, bool]:
        """Returns whether each touch sensor senses the ground."""
        felt = dict.fromkeys(self._sites, False)
        by_link: dict[int, list[np.ndarray]] = {}
        for contact in self._contacts():
            if contact.force > 0 or contact.depth >= 0:  # there is no force before the first step
                by_link.setdefault(contact.link, []).append(contact.position)
        model = self._robot.model
        for name, site in self._sites.items():
            link = self._links.get(model.body(model.site_bodyid[site]).name)
            if link not in by_link:
                continue
            state = pybullet.getLinkState(
                self._body, link, computeForwardKinematics=1, physicsClientId=self.client
            )
            foot, _ = pybullet.multiplyTransforms(
                state[4], state[5], model.site_pos[site], [0, 0, 0, 1]
            )
            reach = FOOT_TOLERANCE * float(model.site_size[site, 0])
            felt[name] = any(np.linalg.norm(at - foot) <= reach for at in by_link[link])
        return felt

    def positions(self) -> dict[str, np.ndarray]:
        """Returns the position of each present body other than the root, m."""
        return {
            name: np.array(
                pybullet.getLinkState(
                    self._body, link, computeForwardKinematics=1, physicsClientId=self.client
                )[4]
            )
            for name, link in self._links.items()
        }

    def mass(self) -> float:
        """Returns the total mass, kg."""
        links = (-1, *self._links.values())
        client = {"physicsClientId": self.client}
        masses = [pybullet.getDynamicsInfo(self._body, link, **client)[0] for link in links]
        return float(sum(masses))

    def _contacts(self) -> list[_Contact]:
        found = pybullet.getContactPoints(self._body, self._ground, physicsClientId=self.client)
        return [_Contact(point[3], np.array(point[5]), -point[8], point[9]) for point in found]
