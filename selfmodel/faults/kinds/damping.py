"""Damped joint: the viscous damping of the joint is scaled by a factor.

The severity is a factor from 0 to 100; 1 is nominal. A joint without damping in the model gets
``factor - 1`` times the damping that slows it with a time constant of 1 s. The velocity gain of a
servo is no part of the damping. The search proposes larger damping only: smaller damping has hardly
an effect beside the velocity gain of a servo. A jammed joint, and a broken joint at or before the
joint, absorb its damping.
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, joints, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    for hinge in anatomy.joint(fault.part).hinges:
        embodiment.scale_damping(hinge, fault.severity)


DAMPED_JOINT = FaultKind(
    name="damping",
    keyword="damping",
    parts=joints,
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 100.0),
    levels=uniform_levels(3.0, 10.0, 30.0),
    degenerates_to={1.0: None},
    unit="times",
    is_of_joint=True,
)
