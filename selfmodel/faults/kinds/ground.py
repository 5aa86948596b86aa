"""Environment kinds of the ground: sliding friction and slope."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _grip(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.set_friction(fault.severity)


def _tilt(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.tilt_ground(fault.severity)


FRICTION = FaultKind(
    name="friction",
    keyword="friction",
    apply=_grip,
    severity_bounds=uniform_bounds(0.01, 3.0),
    levels=uniform_levels(0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.5),
    unit="(coefficient)",
)
"""Coefficient of sliding friction between the ground and all geoms. No severity is nominal for
every robot: the nominal friction is the model's."""

SLOPE = FaultKind(
    name="slope",
    keyword="slope",
    apply=_tilt,
    severity_bounds=uniform_bounds(-0.6, 0.6),
    levels=uniform_levels(-0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
)
"""Angle of the ground along forward, uphill positive. The ground and the initial pose are rotated
about the initial position, and gravity is unchanged: the world's z axis points up in every logged
signal, as in odometry that is aligned with gravity by an IMU."""
