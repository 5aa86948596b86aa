"""A jammed joint: it is held rigidly, at 0 or at an angle."""

from typing import TYPE_CHECKING

from selfmodel.anatomy import Anatomy
from selfmodel.faults.joints import joints
from selfmodel.faults.kind import Fault, Kind
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.faults.sensor import FAILED_SENSOR, SENSOR_GAIN

if TYPE_CHECKING:
    from selfmodel.embodiment import Embodiment

LEVELS = 12
"""Angles that a genome proposes, evenly inside the joint's range: 0.09 rad apart for 60 degrees."""


def _strike(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    joint = anatomy.joint(fault.part)
    for hinge in joint.hinges:
        embodiment.hold_hinge(hinge, fault.degree)
    for motor in joint.motors:
        embodiment.release_motor(anatomy.motors.index(motor))
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in joint.hinges:
            embodiment.fix_reading(column, fault.degree / sensor.half_range)


def _absorbs_at_zero(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """A sensor of a joint held at 0 reads 0; so does a failed one, and any multiple of it is 0.

    Of a joint that is said to be held at 0 and at another angle, 0 counts.
    """
    if other.kind in (FAILED_SENSOR, SENSOR_GAIN):
        return anatomy.sensor(other.part).hinge in anatomy.joint(fault.part).hinges
    return other.part == fault.part and other.kind in (WEAK_MOTOR, JAMMED_AT_ANGLE)


def _absorbs_at_angle(fault: Fault, other: Fault, _anatomy: Anatomy) -> bool:
    """A joint that nothing turns is not turned by its motor either."""
    return other.part == fault.part and other.kind == WEAK_MOTOR


def _degrees(anatomy: Anatomy, part: str) -> tuple[float, float]:
    limits = anatomy.joint(part).limits
    return max(low for low, _ in limits), min(high for _, high in limits)


def _levels(anatomy: Anatomy, part: str) -> tuple[float, ...]:
    low, high = _degrees(anatomy, part)
    angles = (low + (high - low) * (k + 0.5) / LEVELS for k in range(LEVELS))
    return tuple(dict.fromkeys(round(angle, 3) + 0.0 for angle in angles if round(angle, 3)))


JAMMED = Kind(name="jam", word="jam", parts=joints, strike=_strike, absorbs=_absorbs_at_zero)

JAMMED_AT_ANGLE = Kind(
    name="jam-angle",
    word="jam",
    parts=joints,
    strike=_strike,
    absorbs=_absorbs_at_angle,
    degrees=_degrees,
    levels=_levels,
    special={0.0: JAMMED},
    unit="rad",
)
