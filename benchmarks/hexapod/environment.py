"""The hexapod in PyBullet under Bullet's own position motors, at Bullet's own time step."""

import dataclasses
from xml.etree import ElementTree as ET

import numpy as np
import pybullet

from benchmarks.hexapod.robots import EFFORT, VELOCITY, retracted, urdf
from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.client import scale, with_faults
from benchmarks.other_engine.environment import BulletEnvironment
from benchmarks.other_engine.reality import Damage, Reality, ideal_reality
from selfmodel.robot.robot import Robot

TIMESTEP = 1 / 240
"""Bullet's time step, s."""


def reality_of(robot: Robot, seed: int) -> Reality:
    """Returns the robot of a seed: masses and torques within 5 %, and friction of 0.7 to 1.0.

    Its commands are one of Bullet's steps late; the noise is the same for all seeds.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(36,)))
    masses, torques = (
        tuple(map(float, rng.uniform(0.95, 1.05, count)))
        for count in (robot.model.nbody, robot.model.nu)
    )
    return dataclasses.replace(
        ideal_reality(robot),
        seed=seed,
        masses=masses,
        torques=torques,
        delay=1,
        friction=float(rng.uniform(0.7, 1.0)),
        start_angle=0.01,
        angle_noise=0.005,
        encoder_noise=0.005,
        speed_noise=0.1,
        position_noise=0.002,
        tilt_noise=0.005,
        velocity_noise=0.02,
        turn_noise=0.02,
    )


class Hexapod(Bullet):
    """The hexapod with the joints of some legs fixed; its motors have one position gain."""

    def __init__(self, robot: Robot, reality: Reality, damage: Damage, gain: float) -> None:
        tree = ET.fromstring(urdf())  # noqa: S314  # our own text
        for link in tree.findall("link"):
            scale(link, reality.masses[robot.model.body(link.get("name")).id])
        faulty = with_faults(tree, damage.lost, damage.fixed)
        super().__init__(robot, reality, damage, faulty, TIMESTEP)
        self._gain = gain

    def follow(self, targets: np.ndarray) -> None:
        """Advances by a step of Bullet towards an angle of each hinge of the model, rad.

        Source: PyBullet's quick start guide, ``POSITION_CONTROL``: the speed of a joint becomes
        the gain times the error in a step, as far as the largest force and speed allow.
        """
        efforts = EFFORT * np.array(self._reality.torques)
        for joint, target, effort in zip(
            self._hinges, targets[self._present], efforts[self._present], strict=True
        ):
            self._call(
                *("setJointMotorControl2", self._body, joint, pybullet.POSITION_CONTROL, target),
                force=effort,
                positionGain=self._gain,
                velocityGain=1.0,
                maxVelocity=VELOCITY,
            )
        self._call("stepSimulation")


class HexapodEnvironment(BulletEnvironment):
    """A hexapod of a seed with failed legs, such as ``front_left+back_left`` or ``intact``."""

    def __init__(self, robot: Robot, seed: int, legs: str, gain: float, stream: int = 0) -> None:
        reality, damage = reality_of(robot, seed), Damage(fixed=retracted(legs))
        self._hexapod = Hexapod(robot, reality, damage, gain)
        super().__init__(robot, reality, damage, stream, self._hexapod)

    def _drive(self) -> None:
        self._hexapod.follow(self._targets)
