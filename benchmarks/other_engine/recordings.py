"""Recordings of a Unitree A1 in PyBullet, in the form of those of ``benchmarks.foreign``.

The robot is the URDF of ``pybullet_data``, with position servos of usual gains; its encoders, its
commands and an IMU are recorded. Nothing of selfmodel is imported: faults are made in the URDF, in
the servos and in the encoders.
"""

import dataclasses
import json
import shutil
import tempfile
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pybullet
import pybullet_data

from benchmarks.foreign.cases import CASES, Fault, Faults, notation, stream
from benchmarks.foreign.model import LEVELS
from benchmarks.foreign.motion import TAIL, Gait, Motion, draw_gait
from benchmarks.foreign.recorder import Noise, encoders_of, mapping, recorded, write_bag
from benchmarks.foreign.robots import Part, Robot
from benchmarks.other_engine.urdf import fix, part, root_motion, scale

FOLDER = Path(pybullet_data.getDataPath(), "a1")
URDF = FOLDER / "a1.urdf"

SUBSTEP = 0.001
"""Time step of Bullet's physics and of the servos, s."""

STANCE = {"hip": 0.0, "upper": 0.9, "lower": -1.8}
"""Angle of each kind of joint in the initial pose, rad."""

STIFFNESS, DAMPING, TORQUE = 100.0, {"hip": 1.0, "upper": 2.0, "lower": 2.0}, 33.5
"""Gains of the position servos, N m/rad and N m s/rad, and their largest torque, N m.

Source: the code of X. B. Peng et al., Learning agile robotic locomotion skills by imitating
animals, RSS 2020.
"""

GAP = "moderate"
"""Gap of ``benchmarks.foreign`` that has the noise of the sensors."""

SETTLING = 1.0
"""Time that the robot stands before the first command of the gait, s."""

SETTINGS = f"""\
pose = {{"*_hip_joint" = {STANCE["hip"]}, "*_upper_joint" = {STANCE["upper"]}, \
"*_lower_joint" = {STANCE["lower"]}}}
kp = {STIFFNESS}
kd = {{"*_hip_joint" = {DAMPING["hip"]}, "*_upper_joint" = {DAMPING["upper"]}, \
"*_lower_joint" = {DAMPING["lower"]}}}
effort = {TORQUE}
"""
"""What a user knows of the robot beside its URDF, as ``a1.toml``."""

RECORDED = ("healthy", "motor", "jam-angle", "break", "encoder")
"""Names of the recorded cases: those of ``benchmarks.foreign``, but for the strength of a motor."""


@dataclass(frozen=True)
class Plan:
    """What to record: a healthy trial with a trot, and one of the robot with a fault.

    With ``own_gait``, there are two healthy trials, and the other trial has another gait: a walk.
    """

    case: str
    seed: int
    own_gait: bool = False
    duration: float = 10.0

    @property
    def name(self) -> str:
        """Name of the folder of the recording."""
        return f"a1-{self.case}-{self.seed}{'-own' * self.own_gait}"

    def stream(self, *words: str) -> np.random.Generator:
        """Returns a random stream of this case."""
        return stream(self.seed, "a1", self.case, *words)


@dataclass(frozen=True)
class Reality:
    """The draws of one robot."""

    masses: Mapping[str, float]
    """Factor of mass and inertia by link."""
    torques: np.ndarray
    """Factor of the torque of each motor."""
    friction: float
    delay: int
    """Time from a command to its effect, in substeps."""


def record(out: Path, plan: Plan) -> Path:
    """Writes the bags, mappings and ``truth.json`` of a plan, and returns their folder."""
    folder, robot = out / plan.name, a1()
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(FOLDER, folder)
    (folder / "a1.toml").write_text(SETTINGS)
    rng = plan.stream("reality")
    reality = Reality(
        masses={part.body: rng.uniform(0.95, 1.05) for part in robot.parts},
        torques=rng.uniform(0.95, 1.05, len(robot.motors)),
        friction=float(rng.uniform(0.6, 1.0)),
        delay=int(rng.integers(5, 21)),
    )
    faults = _faults(plan, robot)
    trot, other = (
        draw_gait(robot, "stride", plan.stream("gait", str(number))) for number in range(2)
    )
    walk = draw_gait(robot, "walk", plan.stream("gait", "walk"))

    def trial(name: str, present: Faults, gait: Gait) -> Motion:
        motion = simulated(robot, reality, present, gait, plan.duration)
        noises, noise = plan.stream(name), Noise().scaled(LEVELS[GAP])
        encoders = encoders_of(robot, present, -1.0, dict.fromkeys(robot.hinges, 1))
        items = recorded(robot, motion, encoders, noise, noises)
        write_bag(folder / name, items, noise.lost, noises, mcap=plan.seed % 2 == 0)
        text = mapping(robot, encoders, plan.duration, healthy=name.startswith("before"))
        (folder / f"{name}.toml").write_text(text)
        return motion

    before = trial("before", (), trot)
    if plan.own_gait:
        trial("before-2", (), other)
    after = trial("after-1", faults, walk if plan.own_gait else trot)
    truth = {
        **dataclasses.asdict(plan),
        "robot": robot.name,
        "gap": GAP,
        "trials": 1,
        "group": CASES[plan.case].group,
        "truth": notation(faults),
        "faults": [dataclasses.asdict(fault) for fault in faults],
        "onset": None,
        "displacement_healthy": before.displacement(plan.duration).tolist(),
        "displacement_after": after.displacement(plan.duration).tolist(),
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return folder


def a1() -> Robot:
    """Returns the names of the robot's parts, in the order of its URDF."""
    joints = {
        str(joint.get("name")): str(part(joint, "child").get("link"))
        for joint in _urdf().findall("joint")
        if joint.get("type") == "revolute"
    }
    hinges = tuple(joints)
    return Robot(
        name="a1",
        path=URDF,
        mapped_as=URDF.name,
        root="trunk",
        hinges=hinges,
        motors={hinge: hinge for hinge in hinges},
        touches={},
        parts=tuple(
            Part(hinge, joints[hinge], (hinge,), hinges[k : k - k % 3 + 3], ())
            for k, hinge in enumerate(hinges)
        ),
        control_timestep=0.02,
        has_odometry=False,
    )


def _urdf() -> ET.Element:
    return ET.parse(URDF).getroot()  # noqa: S314  # a file of an installed package


def _stance(hinge: str) -> float:
    return STANCE[hinge.split("_")[1]]


def _faults(plan: Plan, robot: Robot) -> Faults:
    """Draws the faults of a case, at a joint that carries load."""
    rng = plan.stream("faults")
    hinge = str(rng.choice([name for name in robot.hinges if "hip" not in name]))
    match plan.case:
        case "motor":
            return (Fault("motor", hinge, 0.4),)
        case "jam-angle":
            away = rng.choice((-1, 1)) * rng.uniform(0.1, 0.3)
            return (Fault("jam", hinge, round(_stance(hinge) + float(away), 3)),)
        case "break":
            lower = hinge.replace("upper", "lower")
            return (Fault("lost", lower, encoders=str(rng.choice(("freezes", "follows")))),)
        case "encoder":
            return (Fault("encoder", hinge, encoders="none"),)
    return ()


def simulated(
    robot: Robot, reality: Reality, faults: Faults, gait: Gait, duration: float
) -> Motion:
    """Simulates a trial of a duration, and of ``TAIL`` after it, s, of a robot that stands."""
    target = np.array([_stance(hinge) for hinge in robot.hinges])
    substeps = round(robot.control_timestep / SUBSTEP)
    count = round((duration + TAIL) / robot.control_timestep)
    rows, commands, sent = list[np.ndarray](), list[np.ndarray](), deque[tuple[int, np.ndarray]]()
    body = _Body(robot, reality, faults)
    for step in range(-round(SETTLING / SUBSTEP), count * substeps):
        now = step * SUBSTEP
        if step >= 0:
            rows.append(body.row(now))
        if step >= 0 and step % substeps == 0:
            commands.append(gait(now, target, np.zeros(0)))
            sent.append((step + reality.delay, commands[-1]))
        if sent and sent[0][0] <= step:
            target = sent.popleft()[1]
        body.step(target)
    body.close()
    time, pose, twist, angles, speeds = np.split(
        np.array(rows), [1, 8, 14, 14 + len(target)], axis=1
    )
    clock, touch = robot.control_timestep * np.arange(count), np.zeros((count, 0))
    return Motion(time[:, 0], angles, speeds, pose, twist, clock, np.array(commands), touch)


class _Body:
    """The robot on the ground in a client of PyBullet, with its servos; ``close`` ends it."""

    def __init__(self, robot: Robot, reality: Reality, faults: Faults) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._call("setGravity", 0, 0, -9.81)
        self._call("setTimeStep", SUBSTEP)
        plane = self._call("createCollisionShape", pybullet.GEOM_PLANE)
        ground = self._call("createMultiBody", 0, plane)
        self._call("changeDynamics", ground, -1, lateralFriction=1.0)
        self._body = self._loaded(_with_faults(reality, faults))
        infos = [
            self._call("getJointInfo", self._body, joint)
            for joint in range(self._call("getNumJoints", self._body))
        ]
        joints = {i[1].decode(): i[0] for i in infos if i[2] == pybullet.JOINT_REVOLUTE}
        self._there = np.array([name in joints for name in robot.hinges])
        self._joints = list(joints.values())
        for link in range(-1, len(infos)):
            self._call("changeDynamics", self._body, link, lateralFriction=reality.friction)
        for name, joint in joints.items():
            self._call("resetJointState", self._body, joint, _stance(name))
        # Each joint of PyBullet begins with a motor that holds it.
        self._motors(pybullet.VELOCITY_CONTROL, [0.0] * len(self._joints))
        fixed = {fault.part: fault.value for fault in faults if fault.kind == "jam"}
        self._fixed = np.array([fixed.get(name, np.nan) for name in robot.hinges])
        self._damping = np.array([DAMPING[name.split("_")[1]] for name in joints])
        weak = {fault.part: fault.value for fault in faults if fault.kind == "motor"}
        self._factor = np.array(
            [reality.torques[robot.hinges.index(name)] * weak.get(name, 1.0) for name in joints]
        )
        self._inertial = self._call("getDynamicsInfo", self._body, -1)[3:5]
        self._stand()

    def close(self) -> None:
        """Ends the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def _call(self, function: str, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401  # PyBullet's
        return getattr(pybullet, function)(*arguments, physicsClientId=self._client, **options)

    def _motors(self, mode: int, forces: list[float]) -> None:
        self._call("setJointMotorControlArray", self._body, self._joints, mode, forces=forces)

    def _loaded(self, urdf: str) -> int:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, URDF.name)
            path.write_text(urdf)
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            return int(self._call("loadURDF", str(path), flags=flags))

    def _stand(self) -> None:
        """Moves the robot so that its lowest point is on the ground."""
        links = range(-1, self._call("getNumJoints", self._body))
        lowest = min(self._call("getAABB", self._body, link)[0][2] for link in links)
        position, turn = self._call("getBasePositionAndOrientation", self._body)
        raised = (*position[:2], position[2] - lowest)
        self._call("resetBasePositionAndOrientation", self._body, raised, turn)

    def _states(self) -> np.ndarray:
        """Returns angle, rad, and angular velocity, rad/s, of each joint there is."""
        states = self._call("getJointStates", self._body, self._joints)
        return np.array([state[:2] for state in states]).T

    def step(self, target: np.ndarray) -> None:
        """Advances by a substep under commanded angles, rad."""
        angles, speeds = self._states()
        torque = STIFFNESS * (target[self._there] - angles) - self._damping * speeds
        torque = self._factor * np.clip(torque, -TORQUE, TORQUE)
        self._motors(pybullet.TORQUE_CONTROL, torque.tolist())
        self._call("stepSimulation")

    def row(self, time: float) -> np.ndarray:
        """Returns a time, and the pose, the twist, the angles and the speeds of a ``Motion``."""
        angles, speeds = self._fixed.copy(), np.zeros(len(self._fixed))
        angles[self._there], speeds[self._there] = self._states()
        centre = self._call("getBasePositionAndOrientation", self._body)
        twist = self._call("getBaseVelocity", self._body)
        position, orientation, linear, own = root_motion(centre, twist, self._inertial)
        pose = [*position, *orientation.as_quat(scalar_first=True)]
        return np.concatenate([[time], pose, linear, own, angles, speeds])


def _with_faults(reality: Reality, faults: Faults) -> str:
    """Returns the URDF of a robot with its masses, with locked and without lost joints."""
    tree = _urdf()
    links = {str(link.get("name")): link for link in tree.findall("link")}
    joints = {str(joint.get("name")): joint for joint in tree.findall("joint")}
    for link in links.values():
        for visual in link.findall("visual"):  # their meshes are beside the file
            link.remove(visual)
        scale(link, reality.masses.get(str(link.get("name")), 1.0))
    for fault in faults:
        match fault.kind:
            case "jam":
                fix(joints[fault.part], fault.value)
            case "lost":
                beyond = [fault.part, fault.part.replace("lower_joint", "toe_fixed")]
                for name in beyond:
                    tree.remove(links[str(part(joints[name], "child").get("link"))])
                    tree.remove(joints[name])
    return ET.tostring(tree, encoding="unicode")
