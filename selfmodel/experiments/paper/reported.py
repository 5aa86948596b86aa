"""What the paper reports, as far as it is available, and what is not.

Source: J. C. Bongard and H. Lipson, *Automated Damage Diagnosis and Recovery for Remote Robotics*
(ICRA 2004): its abstract, and the part of its text that survives. Its figures and the numbers of
its Table II are not available, so nothing here is read from them.
"""

from collections.abc import Mapping
from types import MappingProxyType

FAILURES: Mapping[int, str] = MappingProxyType(
    {
        1: "a lower leg breaks off",
        2: "a whole leg breaks off",
        3: "a touch sensor fails",
        4: "2, and the touch sensor of another leg fails",
        5: "an angle sensor fails",
        6: "an upper-leg joint jams",
        7: "2, and the upper-leg joint of another leg jams",
        8: "7, and the angle sensor of a further leg fails",
        9: "nothing fails",
        10: "a hidden neuron fails",
    }
)
"""Failures by their number in Table I."""

NOT_RESTORED: Mapping[str, tuple[int, ...]] = MappingProxyType(
    {"quadruped": (7, 8), "hexapod": (4, 7, 10)}
)
"""Cases in which the function was not restored, by robot."""

EVALUATIONS_ON_ROBOT = 3000
"""The abstract has more evaluations than these for evolution on the physical robot."""

RESTORED_ON_ROBOT = 0.7
"""About this much of the function is restored by evolution on the physical robot."""

UNKNOWN = (
    "the content of Figures 1, 5 and 6 and their numbers",
    "the layout and the numbers of Table II",
    "the number of runs of each case, and the displacements in metres",
    "the share of the function from which the paper counts it as restored",
)
"""What could not be established."""


def is_restored(robot: str, case: int) -> bool:
    """Returns whether the paper reports that a robot's function was restored in a case."""
    return case not in NOT_RESTORED[robot]
