"""A broken joint: it and the limb beyond it fall off."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.motor import WEAK_MOTOR
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    """Loses the limb, and with it its readings."""
    lost = anatomy.joint(fault.part).bodies
    for name in lost:
        embodiment.detach_body(name)
    for column, sensor in enumerate(anatomy.sensors):
        if sensor.body in lost:
            embodiment.fix_reading(column, 0.0)


def _absorbs(fault: Fault, other: Fault, anatomy: Anatomy) -> bool:
    """Whatever is wrong with a part that fell off no longer matters."""
    if other.part == fault.part:
        return other.kind != fault.kind
    broken = anatomy.joint(fault.part)
    if other.kind == WEAK_MOTOR and broken.motors_lost_if_broken.issuperset(
        anatomy.joint(other.part).motors
    ):
        return True
    return other.part in broken.descendants


def _joints_with_limbs(anatomy: Anatomy) -> tuple[str, ...]:
    """A body without a name cannot be told from others."""
    return tuple(joint.name for joint in anatomy.joints if "" not in joint.bodies)


BROKEN = FaultKind(
    name="break", keyword="break", parts=_joints_with_limbs, apply=_apply, absorbs=_absorbs
)
