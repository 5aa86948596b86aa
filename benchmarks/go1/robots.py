"""The physical Go1s: their faults, their reality gap, their policy and the logs of their walks."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import selfmodel
from selfmodel import Controller, Robot, Trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.studies.experiment import draw_reality

SCENE = "mujoco_playground/_src/locomotion/go1/xmls/scene_mjx_feetonly_flat_terrain.xml"
NETWORK = "go1_policy.onnx"
SETTINGS, STEPS = MjcfSettings(control_timestep=0.02), 500
"""Settings of the model, and control steps of a trial."""
GAP, DELAY, FRICTION = 0.05, 1, (0.6, 1.2)
"""Level of the gap, added delay, steps, and friction of the grounds; the model's is the first."""

Velocity = tuple[float, float, float]
"""Forward and to the left, m/s, and the turn to the left, rad/s."""
WALK: Velocity = (1.0, 0.0, 0.0)
TURN: Velocity = (0.5, 0.0, 0.8)
"""Command of one of the healthy logs beside a diagnosis; that of the other is straight on."""
OTHERS: dict[str, Velocity] = {"0.5 m/s": (0.5, 0.0, 0.0), "turning right": (0.6, 0.0, -0.7)}
OTHERS |= {"standing": (0.0, 0.0, 0.0), "1 m/s": WALK}
"""Commands of the healthy logs that are diagnosed."""


@dataclass(frozen=True)
class Go1:
    """The Go1 of a seed; ``files`` has the files of others, and ``work`` gets the logs."""

    files: Path
    work: Path
    seed: int
    robot: Robot

    def policy(self, velocity: Velocity) -> Controller:
        """Returns the policy with a commanded velocity."""
        shutil.copy(self.files / NETWORK, self.work)
        file = self.work / "policy.toml"
        keys = f'network = "{NETWORK}"\npreset = "mujoco_playground"\nvelocity = {[*velocity]}\n'
        file.write_text(keys, encoding="utf-8")
        return selfmodel.load_policy(file, self.robot)

    def physical(self, truth: str, stream: int) -> SimulatedRobot:
        """Returns the physical robot with a fault; see ``SimulatedRobot`` for streams."""
        friction = np.random.default_rng(self.seed).uniform(*FRICTION) / FRICTION[0]
        gap = replace(draw_reality(self.robot, self.seed, GAP), friction=friction, delay=DELAY)
        hidden = selfmodel.parse_hypothesis(truth, self.robot)
        return SimulatedRobot(self.robot, hidden, gap, stream)

    def logged(self, own: SimulatedRobot, velocity: Velocity, name: str) -> Trial:
        """Runs and logs a trial, and returns it."""
        path, controller = self.work / f"{name}.mcap", self.policy(velocity)
        return selfmodel.run_trial(own, controller, path, robot=self.robot, steps=STEPS)


def faults(robot: Robot, seed: int) -> Iterator[tuple[str, str]]:
    """Yields the group and the notation of each fault to diagnose."""
    joints = [joint.name for joint in robot.anatomy.joints]
    for gain in (0.5, 0.7):
        yield from ((f"gain {gain}", f"servo-gain:{joint}={gain}") for joint in joints)
    yield "friction 0.3", "friction=0.3"
    for mass in (2.0, 5.0):
        yield f"payload {mass:g} kg", f"payload={mass / robot.model.body_mass.sum():.4f}"
    yield "encoder offset", f"encoder-offset:{joints[(5 * seed + 1) % len(joints)]}=0.1"


def commands(_robot: Robot, _seed: int) -> Iterator[tuple[str, str]]:
    """Yields the name of each of ``OTHERS``, and no fault."""
    return ((name, "intact") for name in OTHERS)


def damages(robot: Robot, _seed: int) -> Iterator[tuple[str, str]]:
    """Yields the group and the notation of each damage to recover from, and of none."""
    for joint in robot.anatomy.joints:
        leg, part, _ = joint.name.split("_")
        end = "front" if leg.startswith("F") else "rear"
        yield f"dead {part}, {end}", f"motor:{joint.name}=0"
        if part == "thigh":
            yield f"locked {part}, {end}", f"jam:{joint.name}"
            dead = (f"motor:{leg}_{each}_joint=0" for each in ("hip", "thigh", "calf"))
            yield f"dead leg, {end}", "+".join(dead)
    yield "intact", "intact"
