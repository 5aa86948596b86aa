"""A fault kind of your own: a robot on another planet.

Usage:
  PYTHONPATH=examples selfmodel recover quadruped --damage gravity=3.7 --kinds jam,gravity:GRAVITY
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot import ModelVariant


class Gravity(FaultKind):
    """Another acceleration of free fall."""

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the acceleration."""
        variant.model.opt.gravity[2] = -fault.severity


GRAVITY = Gravity(
    name="gravity",
    bounds=(0.0, 30.0),
    levels=(1.0, 1.6, 2.5, 3.7, 5.0, 6.0, 7.0, 8.0, 9.0, 11.0, 12.5, 25.0),
    degenerates_to={9.81: None},
    unit="m/s^2",
    words="objects fall with {severity:.3g} m/s^2",
)
