"""Jammed joint: the hinges of the joint are welded, at 0 or at an angle.

A hinge whose range excludes 0 is welded at the limit nearest to 0.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, joints
from selfmodel.faults.kinds.damping import DAMPED_JOINT
from selfmodel.faults.kinds.joint_friction import JOINT_FRICTION
from selfmodel.faults.kinds.motor import WEAK_MOTOR
from selfmodel.faults.kinds.sensor import FAILED_SENSOR, SENSOR_GAIN
from selfmodel.robot.anatomy import Anatomy, Joint

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment

ANGLE_LEVELS = 12
"""Levels of the angle, evenly spaced inside the joint's range: 0.09 rad apart for 60 degrees."""


def _apply_at_zero(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    joint = anatomy.joint(fault.part)
    _weld(embodiment, anatomy, _nearest_to_zero(joint))


def _apply_at_angle(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    hinges = anatomy.joint(fault.part).hinges
    _weld(embodiment, anatomy, dict.fromkeys(hinges, fault.severity))


def _weld(embodiment: "Embodiment", anatomy: Anatomy, angles: Mapping[str, float]) -> None:
    for hinge, angle in angles.items():
        embodiment.weld_hinge(hinge, angle)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.hinge in angles:
            offset = embodiment.encoder_offset[anatomy.hinges.index(sensor.hinge)]
            embodiment.fix_reading(column, sensor.reading(angles[sensor.hinge] + offset))


def _nearest_to_zero(joint: Joint) -> dict[str, float]:
    return {
        hinge: min(max(low, 0.0), high)
        for hinge, (low, high) in zip(joint.hinges, joint.limits, strict=True)
    }


def _absorbs_at_zero(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """Returns whether a fault of the joint's sensor, motor or angle has no further effect.

    A sensor of the welded hinge that reads 0 reads 0 if it fails or with any gain. A joint jammed
    at 0 and at another angle is jammed at 0.
    """
    if other.kind in (FAILED_SENSOR, SENSOR_GAIN):
        sensor, angles = anatomy.sensor(other.part), _nearest_to_zero(anatomy.joint(fault.part))
        return sensor.hinge in angles and sensor.reading(angles[sensor.hinge]) == 0
    if other.part == fault.part and other.kind == JAMMED_AT_ANGLE:
        return True
    return _absorbs(fault, other, anatomy)


def _absorbs(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """Returns whether a fault of the joint's resistance or motor has no further effect.

    The motors of a welded joint have no effect unless they move another joint too.
    """
    if other.part != fault.part:
        return False
    if other.kind in (DAMPED_JOINT, JOINT_FRICTION):
        return True
    if other.kind != WEAK_MOTOR:
        return False
    joint = anatomy.joint(fault.part)
    return joint.motors_lost_if_jammed.issuperset(joint.motors)


def _joints_with_angles(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the joints with a common angle of all hinges other than that of ``JAMMED``."""
    return tuple(joint.name for joint in anatomy.joints if _levels(anatomy, joint.name))


def _severity_bounds(anatomy: Anatomy, part: str) -> tuple[float, float]:
    limits = anatomy.joint(part).limits
    return max(low for low, _ in limits), min(high for _, high in limits)


def _levels(anatomy: Anatomy, part: str) -> tuple[float, ...]:
    low, high = _severity_bounds(anatomy, part)
    if low >= high:
        return ()
    angles = (low + (high - low) * (k + 0.5) / ANGLE_LEVELS for k in range(ANGLE_LEVELS))
    return tuple(dict.fromkeys(round(angle, 3) + 0.0 for angle in angles if round(angle, 3)))


JAMMED = FaultKind(
    name="jam",
    keyword="jam",
    parts=joints,
    apply=_apply_at_zero,
    absorbs=_absorbs_at_zero,
    is_of_joint=True,
)

JAMMED_AT_ANGLE = FaultKind(
    name="jam-angle",
    keyword="jam",
    parts=_joints_with_angles,
    apply=_apply_at_angle,
    absorbs=_absorbs,
    severity_bounds=_severity_bounds,
    levels=_levels,
    degenerates_to={0.0: JAMMED},
    unit="rad",
    is_of_joint=True,
)
