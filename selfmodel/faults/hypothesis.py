"""Hypothesis: a set of faults and environments in canonical form."""

from collections.abc import Iterable
from dataclasses import dataclass

from selfmodel.errors import typed
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy


@typed
@dataclass(frozen=True, order=True)
class Hypothesis:
    """A set of faults; the empty set is the nominal robot.

    ``canonical``, ``notation.parse`` and ``HypothesisSpace`` make hypotheses in canonical form, in
    which equal hypotheses have equal effects on a robot. The constructor does not check its
    argument.

    Example:
        >>> import selfmodel
        >>> both = selfmodel.parse_hypothesis("jam:back_left_knee+friction=0.4", "quadruped")
        >>> print(both, len(both))
        friction=0.4+jam:back_left_knee 2

    Attributes:
        faults: Faults, sorted, without faults that another fault absorbs.
    """

    faults: tuple[Fault, ...] = ()

    def __str__(self) -> str:
        return "+".join(str(fault) for fault in self.faults) or "intact"

    def __len__(self) -> int:
        return len(self.faults)

    @property
    def words(self) -> str:
        """The faults as clauses in plain words."""
        return ", and ".join(fault.words for fault in self.faults) or "nothing is wrong"

    @property
    def dynamics_part(self) -> "Hypothesis":
        """The faults that change the robot's motion under given commands."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.affects_dynamics))

    @property
    def spec_part(self) -> "Hypothesis":
        """The faults that edit the specification before it is compiled."""
        return Hypothesis(tuple(fault for fault in self.faults if fault.kind.edits_specification))

    @property
    def without_severities(self) -> frozenset[tuple[FaultKind, str]]:
        """The kind and the part of each fault."""
        return frozenset((fault.kind.without_severity, fault.part) for fault in self.faults)

    def lacking(self, other: "Hypothesis") -> list[Fault]:
        """Returns the faults that another hypothesis lacks, whatever their severities."""
        kept = other.without_severities
        return [one for one in self.faults if not Hypothesis((one,)).without_severities <= kept]


INTACT = Hypothesis()
"""The empty hypothesis: the nominal robot in the nominal environment."""


def canonical(faults: Iterable[Fault], anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis with the fewest faults that has the same effects on a robot.

    Order and repetition do not matter. Faults with a nominal severity and faults that another
    fault absorbs are dropped: a joint beyond a broken joint is detached, whatever its fault. Of
    several severities of one kind at one part the first is kept; of several faults of a kind with
    ``is_single``, the first in the order of faults.
    """
    distinct: dict[tuple[FaultKind, str], Fault] = {}
    given = filter(None, (fault.canonical for fault in faults))
    for fault in sorted(given, key=lambda one: (one.kind, one.part if one.kind.is_single else "")):
        distinct.setdefault((fault.kind, "" if fault.kind.is_single else fault.part), fault)

    def absorbs(one: Fault, other: Fault) -> bool:
        return one is not other and one.kind.absorbs(one, other, anatomy)

    for key, fault in list(distinct.items()):
        simpler, others = fault.canonical_alone, distinct.keys() - {key}
        if simpler is not fault and not any(absorbs(simpler, distinct[one]) for one in others):
            del distinct[key]
            distinct[simpler.kind, simpler.part] = simpler
    listed = distinct.values()
    kept = (one for one in listed if not any(absorbs(other, one) for other in listed))
    return Hypothesis(tuple(sorted(kept)))
