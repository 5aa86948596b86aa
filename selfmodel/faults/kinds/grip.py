"""Lost grip: the sliding friction of one foot is scaled by a factor.

The severity is a factor from 0 to 1 of the friction of every contact of the foot; 1 is nominal. The
foot is what the last joint of a limb moves, and has the name of that joint. The friction of the
ground, ``friction``, applies to all feet, and the factor to what results. A broken joint at or
before the foot absorbs the fault.
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _last_joints(anatomy: Anatomy) -> tuple[str, ...]:
    names = {joint.name for joint in anatomy.joints}
    return tuple(
        joint.name
        for joint in anatomy.joints
        if "" not in joint.bodies and not joint.descendants & names
    )


def _apply(embodiment: "Embodiment", anatomy: Anatomy, fault: Fault) -> None:
    embodiment.scale_grip(sorted(anatomy.joint(fault.part).bodies), fault.severity)


LOST_GRIP = FaultKind(
    name="grip",
    keyword="grip",
    parts=_last_joints,
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 1.0),
    levels=uniform_levels(0.1, 0.2, 0.4),
    degenerates_to={1.0: None},
    unit="of its friction",
)
