"""The ground: how slippery it is, and how it slopes."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, Kind, between, grid
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _grip(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.set_friction(fault.degree)


def _tilt(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.tilt_ground(fault.degree)


FRICTION = Kind(
    name="friction",
    word="friction",
    strike=_grip,
    degrees=between(0.01, 3.0),
    levels=grid(0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.5),
    unit="(coefficient)",
)
"""The coefficient of sliding friction between the ground and everything that touches it. It has no
degree that means nothing: which friction is nominal is the model's affair."""

SLOPE = Kind(
    name="slope",
    word="slope",
    strike=_tilt,
    degrees=between(-0.6, 0.6),
    levels=grid(-0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
    special={0.0: None},
    unit="rad",
)
"""The angle of the ground along forward, uphill positive. The ground and the robot's start pose are
turned about the start, and gravity stays: the world's z axis points up in every logged signal, as
for a robot whose odometry knows from its IMU where up is."""
