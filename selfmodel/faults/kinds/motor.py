"""Weak motor: the torque of the motor is scaled by a factor below 1."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import (
    Fault,
    FaultKind,
    joints_with_motors,
    uniform_bounds,
    uniform_levels,
)
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    motors = [anatomy.motors.index(motor) for motor in anatomy.joint(fault.part).motors]
    embodiment.weaken_motors(motors, fault.severity)


WEAK_MOTOR = FaultKind(
    name="motor",
    keyword="motor",
    parts=joints_with_motors,
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 1.0),
    levels=uniform_levels(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    degenerates_to={1.0: None},
    unit="of its torque",
    is_of_joint=True,
)
