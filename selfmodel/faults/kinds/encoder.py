"""Encoder offset: the encoder of a joint measures its angle plus a constant.

The severity is the measured minus the true angle from -1 to 1 rad; 0 is nominal. It shifts the
logged joint positions and the readings of the angle sensors of the joint. The servo of a motor is
not affected: it has a measurement of its own. A prediction begins at the true angle, which is the
logged angle minus the offset. A broken joint at or before the joint absorbs the fault; a jammed
joint does not, because its constant angle is measured with the offset.
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, joints, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.editing.embodiment import Embodiment


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    hinges = anatomy.joint(fault.part).hinges
    for hinge in hinges:
        embodiment.encoder_offset[anatomy.hinges.index(hinge)] = fault.severity
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in hinges:
            embodiment.shift_reading(column, fault.severity / sensor.half_range)


ENCODER_OFFSET = FaultKind(
    name="encoder-offset",
    keyword="encoder-offset",
    parts=joints,
    apply=_apply,
    severity_bounds=uniform_bounds(-1.0, 1.0),
    levels=uniform_levels(-0.3, -0.1, 0.1, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
)
