"""Stiff joint: dry friction in the joint, which stops it below a threshold of torque.

The severity is a fraction of the largest torque of the joint's motors, from 0 to 1, in addition to
the dry friction in the model; 0 is nominal. Only joints with motors have the fault. A jammed joint,
and a broken joint at or before the joint, absorb its friction. A weak motor does not change it.
"""

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
    for hinge in anatomy.joint(fault.part).hinges:
        embodiment.add_dry_friction(hinge, fault.severity)


JOINT_FRICTION = FaultKind(
    name="joint-friction",
    keyword="joint-friction",
    parts=joints_with_motors,
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 1.0),
    levels=uniform_levels(0.1, 0.2, 0.4),
    degenerates_to={0.0: None},
    unit="of the motors' largest torque",
    is_of_joint=True,
)
