"""The hexapod in PyBullet under Bullet's own position motors, at Bullet's own time step."""

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np

from benchmarks.hexapod.robots import EFFORT, VELOCITY, retracted, urdf
from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.client import SUBSTEP, scale, with_faults
from benchmarks.other_engine.environment import BulletEnvironment
from benchmarks.other_engine.reality import Damage, draw_reality
from selfmodel import Robot

TIMESTEP = 1 / 240
"""Bullet's time step, s."""


class HexapodEnvironment(BulletEnvironment):
    """The hexapod of a seed with failed legs, such as ``front_left+back_left``, or ``intact``.

    The gain of its motors is the part of an error that a step of Bullet ends, as far as the effort
    and the largest speed allow. Draws and noise are those of the robots of ``other_engine``.
    """

    def __init__(self, robot: Robot, seed: int, legs: str, gain: float, stream: int = 0) -> None:
        reality, damage = draw_reality(robot, seed), Damage(fixed=retracted(legs))
        reality = replace(reality, delay=round(reality.delay * SUBSTEP / TIMESTEP))
        tree = ET.fromstring(urdf())  # noqa: S314  # our own text
        for link in tree.findall("link"):
            scale(link, reality.masses[robot.model.body(link.get("name")).id])
        faulty = with_faults(tree, damage.lost, damage.fixed)
        bullet = Bullet(robot, reality, damage, faulty, TIMESTEP)
        super().__init__(robot, reality, damage, stream, bullet)
        self._efforts = EFFORT * np.array(reality.torques)
        self._motor = {"positionGain": gain, "velocityGain": 1.0, "maxVelocity": VELOCITY}

    def _drive(self) -> None:
        self._bullet.follow(self._targets, self._efforts, self._motor)
