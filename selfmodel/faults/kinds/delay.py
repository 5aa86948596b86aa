"""Grown delay: commands take effect some control steps later than in the self-model.

The severity is a number of control steps from 0 to 3, in addition to the control delay of the
robot; 0 is nominal. Its effect is that of the nearest whole number of control steps, also of a
fitted severity between two. The delay of the robot and of the fault together is at most
``MAX_CONTROL_DELAY``: segments contain that many commands before their start. The fault has no
part, because all motors share the delay. No fault absorbs it.
"""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _apply(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.added_delay[:] = fault.severity


GROWN_DELAY = FaultKind(
    name="delay",
    keyword="delay",
    apply=_apply,
    severity_bounds=uniform_bounds(0.0, 3.0),
    levels=uniform_levels(1.0, 2.0, 3.0),
    degenerates_to={0.0: None},
    unit="control steps",
)
