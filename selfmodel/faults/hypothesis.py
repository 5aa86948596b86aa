"""A hypothesis: what may be wrong with a robot and its world, in canonical form."""

from collections.abc import Iterable
from dataclasses import dataclass

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy


@dataclass(frozen=True, order=True)
class Hypothesis:
    """A set of faults; none means that nothing changed.

    Make one with ``canonical`` or ``notation.parse``, which know the robot: only then do equal
    hypotheses mean equal robots.

    Attributes:
        faults: Sorted, without those that another leaves no effect.
    """

    faults: tuple[Fault, ...] = ()

    def __str__(self) -> str:
        return "+".join(str(fault) for fault in self.faults) or "intact"

    def __len__(self) -> int:
        return len(self.faults)

    @property
    def dynamics_part(self) -> "Hypothesis":
        """What of it changes how the robot moves under given commands."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.affects_dynamics))

    @property
    def spec_part(self) -> "Hypothesis":
        """What of it is worked into the model before that is compiled."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.edit_spec))


INTACT = Hypothesis()
"""Nothing changed."""


def canonical(faults: Iterable[Fault], anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis that says the same in the fewest words.

    Order and repetition do not matter. A fault that another absorbs is dropped: what lies beyond
    a broken joint is gone, whatever else was wrong with it. So is one whose degree says that
    nothing is wrong. Of several degrees of one kind on one part the first counts.
    """
    distinct: dict[tuple[FaultKind, str], Fault] = {}
    for fault in filter(None, (said.settled for said in faults)):
        distinct.setdefault((fault.kind, fault.part), fault)
    for fault in list(distinct.values()):
        simpler = fault.settled_alone
        rest = [other for other in distinct.values() if other is not fault]
        if simpler is not fault and not any(
            simpler.kind.absorbs(simpler, other, anatomy) for other in rest
        ):
            del distinct[fault.kind, fault.part]
            distinct[simpler.kind, simpler.part] = simpler
    kept = [
        fault
        for fault in distinct.values()
        if not any(
            other.kind.absorbs(other, fault, anatomy)
            for other in distinct.values()
            if other is not fault
        )
    ]
    return Hypothesis(tuple(sorted(kept)))
