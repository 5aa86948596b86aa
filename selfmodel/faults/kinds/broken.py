"""Broken joint: the bodies beyond the joint are detached."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.kinds.motor import WEAK_MOTOR
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    """Detaches the bodies of the limb and zeroes the readings of its sensors."""
    detached = anatomy.joint(fault.part).bodies
    for name in detached:
        embodiment.detach_body(name)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.body in detached:
            embodiment.fix_reading(column, 0.0)


def _absorbs(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """Returns whether the other fault is at a detached part, or of a motor without a load."""
    if other.part == fault.part:
        return other.kind != fault.kind
    broken = anatomy.joint(fault.part)
    if other.kind == WEAK_MOTOR and broken.motors_lost_if_broken.issuperset(
        anatomy.joint(other.part).motors
    ):
        return True
    return other.part in broken.descendants


def _joints_with_limbs(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the joints whose bodies all have names: faults refer to bodies by name."""
    return tuple(joint.name for joint in anatomy.joints if "" not in joint.bodies)


BROKEN = FaultKind(
    name="break", keyword="break", parts=_joints_with_limbs, apply=_apply, absorbs=_absorbs
)
