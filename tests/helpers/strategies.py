"""Strategies for property-based tests: faults and hypotheses about a robot."""

from hypothesis import strategies as st

from selfmodel.faults.hypothesis import Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import KINDS, PAPER_KINDS
from selfmodel.robot.anatomy import Anatomy


def faults(anatomy: Anatomy, *, graded: bool) -> st.SearchStrategy[Fault]:
    """Faults of the paper's kinds, and of any degree of all kinds where ``graded``."""
    kinds = list(KINDS.values()) if graded else list(PAPER_KINDS)
    return st.sampled_from(kinds).flatmap(lambda kind: _fault(kind, anatomy))


def hypotheses(
    anatomy: Anatomy, *, most: int = 4, graded: bool = False
) -> st.SearchStrategy[Hypothesis]:
    """Hypotheses in canonical form."""
    sets = st.lists(faults(anatomy, graded=graded), max_size=most)
    return sets.map(lambda chosen: canonical(chosen, anatomy))


def _fault(kind: FaultKind, anatomy: Anatomy) -> st.SearchStrategy[Fault]:
    parts = st.sampled_from(kind.parts(anatomy))
    if kind.bounds is None:
        return parts.flatmap(
            lambda part: (
                st.tuples(
                    *(
                        st.floats(*ends).map(lambda x: x + 0.0)
                        for ends in _limits(kind, anatomy, part)
                    )
                )
                .flatmap(lambda angles: st.sampled_from([(), angles]))
                .map(lambda angles: Fault(kind, part, angles=angles))
            )
        )
    return parts.flatmap(
        lambda part: st.floats(*kind.bounds_at(anatomy, part)).map(
            lambda severity: Fault(kind, part, severity + 0.0)
        )
    )


def _limits(kind: FaultKind, anatomy: Anatomy, part: str) -> list[tuple[float, float]]:
    return [*kind.hinges(anatomy, part).values()]
