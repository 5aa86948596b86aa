"""A diagnosis: hypotheses ranked by distance to all trials, and a verdict on the best."""

from dataclasses import dataclass
from typing import Literal

from selfmodel.faults.hypothesis import Hypothesis

Verdict = Literal["explained", "ambiguous", "unexplained"]
"""``explained``: the best hypothesis predicts the trials about as well as the self-model predicts
the healthy robot, and no other hypothesis does, ``undetectable`` ones apart. ``ambiguous``: other
hypotheses are indistinguishable from the best. ``unexplained``: the best hypothesis predicts
significantly worse than the self-model predicts the healthy robot, or significantly worse than with
a fault of an unsearched kind, so a fault is missing; requires a trial of the healthy robot."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis and its distance to the trials.

    Attributes:
        hypothesis: In canonical form.
        distance: Sum over the trials of the comparator's distance, in the comparator's unit.
    """

    hypothesis: Hypothesis
    distance: float


@dataclass(frozen=True)
class UnsearchedFault:
    """A hypothesis with one fault of an unsearched kind.

    Attributes:
        hypothesis: The whole hypothesis.
        kind: Name of the unsearched kind.
    """

    hypothesis: Hypothesis
    kind: str

    def as_object(self) -> dict[str, str]:
        """Returns the JSON object."""
        return {"hypothesis": str(self.hypothesis), "kind": self.kind}


@dataclass(frozen=True)
class Diagnosis:
    """Hypotheses ranked against some trials, and a verdict.

    Attributes:
        ranked: Candidates, at least one. The first is the best: the hypothesis with the fewest
            faults of which every one makes the prediction significantly better; for a comparator
            without a significance test, the one with the smallest distance. The others follow by
            distance, at equal distances by number of faults.
        trials: Number of trials.
        intact_distance: Distance of the empty hypothesis.
        indistinguishable: Hypotheses not significantly worse than the best, smallest distance
            first.
        verdict: ``explained``, ``ambiguous`` or ``unexplained``; see ``Verdict``.
        test: Name of the test behind ``indistinguishable``.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it predicts the
            trials significantly better; see ``unsearched.best_unsearched_fault``.
        undetectable: The best hypothesis with one more fault, for each undetectable fault,
            smallest distance first, at most as many as are ranked; see
            ``undetectable.undetectable_faults``.
    """

    ranked: tuple[Candidate, ...]
    trials: int
    intact_distance: float
    indistinguishable: tuple[Hypothesis, ...]
    verdict: Verdict
    test: str
    unsearched: UnsearchedFault | None = None
    undetectable: tuple[Hypothesis, ...] = ()

    @property
    def best(self) -> Hypothesis:
        """The best hypothesis."""
        return self.ranked[0].hypothesis
