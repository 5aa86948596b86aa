"""Recordings of a Unitree A1 in PyBullet, in the form of those of ``benchmarks.foreign``.

The robot is the URDF of ``pybullet_data``, with position servos of usual gains; its encoders, its
commands and an IMU are recorded. Nothing of selfmodel is imported: faults are made in the URDF, in
the servos and in the encoders.
"""

import shutil
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pybullet_data

from benchmarks.foreign.cases import Fault, Faults
from benchmarks.foreign.generate import Plan, write_trial, write_truth
from benchmarks.foreign.motion import TAIL, Gait, Motion, draw_gait
from benchmarks.foreign.recorder import encoders_of
from benchmarks.foreign.robots import Part, Robot
from benchmarks.other_engine.client import SUBSTEP, Client, part, scale, with_faults

FOLDER = Path(pybullet_data.getDataPath(), "a1")
URDF = FOLDER / "a1.urdf"

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
class Reality:
    """The draws of one robot."""

    masses: Mapping[str, float]
    """Factor of mass and inertia by link."""
    torques: np.ndarray
    """Factor of the torque of each motor."""
    friction: float
    delay: int
    """Time from a command to its effect, in substeps."""


def record(out: Path, case: str, seed: int, *, own_gait: bool, duration: float = 10.0) -> Path:
    """Writes a healthy trial with a trot, and one of the robot with a fault, and ``truth.json``.

    With ``own_gait``, there are two healthy trials, and the other trial has another gait: a walk.
    The folder of the trials is returned.
    """
    plan, robot = Plan("a1", case, seed, GAP, duration, trials=1, own_gait=own_gait), a1()
    folder = out / f"a1-{case}-{seed}{'-own' * own_gait}"
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
        motion = simulated(robot, reality, present, gait, duration)
        encoders = encoders_of(robot, present, -1.0, dict.fromkeys(robot.hinges, 1))
        write_trial(folder / name, plan, robot, motion, encoders=encoders, rng=plan.stream(name))
        return motion

    before = trial("before", (), trot)
    if own_gait:
        trial("before-2", (), other)
    after = trial("after-1", faults, walk if own_gait else trot)
    write_truth(folder / "truth.json", plan, faults, None, [before, after])
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
    return Motion.of(robot, rows, commands, np.zeros((count, 0)))


class _Body(Client):
    """The robot on the ground, with its servos."""

    def __init__(self, robot: Robot, reality: Reality, faults: Faults) -> None:
        super().__init__()
        self._call("setTimeStep", SUBSTEP)
        urdf = _with_faults(reality, faults)
        self._load(urdf, robot.hinges, lateralFriction=reality.friction)
        there = [name for name, present in zip(robot.hinges, self._present, strict=True) if present]
        for name, joint in zip(there, self._hinges, strict=True):
            self._call("resetJointState", self._body, joint, _stance(name))
        fixed = {fault.part: fault.value for fault in faults if fault.kind == "jam"}
        self._fixed = np.array([fixed.get(name, np.nan) for name in robot.hinges])
        self._damping = np.array([DAMPING[name.split("_")[1]] for name in there])
        weak = {fault.part: fault.value for fault in faults if fault.kind == "motor"}
        strength = reality.torques * [weak.get(name, 1.0) for name in robot.hinges]
        self._factor = strength[self._present]
        self._stand()

    def _stand(self) -> None:
        """Moves the robot so that its lowest point is on the ground."""
        links = range(-1, self._call("getNumJoints", self._body))
        lowest = min(self._call("getAABB", self._body, link)[0][2] for link in links)
        position, turn = self._call("getBasePositionAndOrientation", self._body)
        raised = (*position[:2], position[2] - lowest)
        self._call("resetBasePositionAndOrientation", self._body, raised, turn)

    def step(self, target: np.ndarray) -> None:
        """Advances by a substep under commanded angles, rad."""
        angles, speeds = self._states()
        torque = STIFFNESS * (target[self._present] - angles) - self._damping * speeds
        self._advance(self._factor * np.clip(torque, -TORQUE, TORQUE))

    def row(self, time: float) -> np.ndarray:
        """Returns a time, and the pose, the twist, the angles and the speeds of a ``Motion``."""
        angles, speeds = self._fixed.copy(), np.zeros(len(self._fixed))
        angles[self._present], speeds[self._present] = self._states()
        position, orientation, linear, own = self.base()
        pose = [*position, *orientation.as_quat(scalar_first=True)]
        return np.concatenate([[time], pose, linear, own, angles, speeds])


def _with_faults(reality: Reality, faults: Faults) -> str:
    """Returns the URDF of a robot with its masses, with locked and without lost joints."""
    tree = _urdf()
    for link in tree.findall("link"):
        for visual in link.findall("visual"):  # their meshes are beside the file
            link.remove(visual)
        scale(link, reality.masses.get(str(link.get("name")), 1.0))
    lost = [fault.part for fault in faults if fault.kind == "lost"]
    lost += [name.replace("lower_joint", "toe_fixed") for name in lost]
    return with_faults(tree, lost, {f.part: f.value for f in faults if f.kind == "jam"})
