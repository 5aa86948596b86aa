"""Encoder offset and encoder slip: the encoder of a joint measures its angle plus a constant.

The severity is the measured minus the true angle from -1 to 1 rad; 0 is nominal. It shifts the
logged joint positions and the readings of the angle sensors of the joint. A prediction begins at
the true angle, which is the logged angle minus the offset.

The two kinds differ in the servos. With ``encoder-offset``, the servo has a measurement of its own
and is not affected. With ``encoder-slip``, the servo uses the encoder: under the same commands, the
true angle is lower by the offset. A joint without a servo, such as one with a torque motor, has the
first kind only. Faults of both kinds at one joint add up.

A broken joint at or before the joint absorbs the fault; a jammed joint does not, because its
constant angle is measured with the offset. Motors that move the jammed joint only have no force, so
both kinds are equal there. A weak motor scales the force that the slip adds, as all of its force.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

from selfmodel.faults.kind import (
    Fault,
    FaultKind,
    joints,
    joints_with_servos,
    uniform_bounds,
    uniform_levels,
)
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _offset(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    hinges = anatomy.joint(fault.part).hinges
    for hinge in hinges:
        embodiment.encoder_offset[anatomy.hinges.index(hinge)] += fault.severity
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in hinges:
            embodiment.shift_reading(column, fault.severity / sensor.half_range)


def _slip(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    _offset(embodiment, anatomy, fault)
    for hinge in anatomy.joint(fault.part).hinges:
        embodiment.shift_feedback(hinge, fault.severity)


ENCODER_OFFSET = FaultKind(
    name="encoder-offset",
    keyword="encoder-offset",
    parts=joints,
    apply=_offset,
    severity_bounds=uniform_bounds(-1.0, 1.0),
    levels=uniform_levels(-0.3, -0.1, 0.1, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
    is_of_joint=True,
)

ENCODER_SLIP = replace(
    ENCODER_OFFSET, name="encoder-slip", prefix="slip", parts=joints_with_servos, apply=_slip
)
