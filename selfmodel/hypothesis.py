"""A hypothesis: what may be wrong with a robot and its world, in canonical form."""

from collections.abc import Iterable
from dataclasses import dataclass

from selfmodel.anatomy import Anatomy
from selfmodel.faults import Fault, Kind


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
    def motion(self) -> "Hypothesis":
        """What of it changes how the robot moves under given commands."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.moves))

    @property
    def shape(self) -> "Hypothesis":
        """What of it is worked into the model before that is compiled."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.reshape))


INTACT = Hypothesis()
"""Nothing changed."""


def canonical(faults: Iterable[Fault], anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis that says the same in the fewest words.

    Order and repetition do not matter. A fault that another absorbs is dropped: what lies beyond
    a broken joint is gone, whatever else was wrong with it. So is one whose degree says that
    nothing is wrong. Of several degrees of one kind on one part the first counts.
    """
    distinct: dict[tuple[Kind, str], Fault] = {}
    for fault in filter(None, (said.settled for said in faults)):
        distinct.setdefault((fault.kind, fault.part), fault)
    struck = [fault.part for fault in distinct.values()]
    for (kind, part), fault in list(distinct.items()):
        if fault.degree in kind.alone and struck.count(part) == 1:
            distinct[kind, part] = Fault(kind.alone[fault.degree], part)
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
