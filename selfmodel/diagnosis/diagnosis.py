"""A diagnosis: hypotheses ranked by how well they explain all trials, and how sure that is."""

from dataclasses import dataclass
from typing import Literal

from selfmodel.faults.hypothesis import Hypothesis

Verdict = Literal["explained", "ambiguous", "unexplained"]
"""``explained``: the best hypothesis predicts the trials about as well as the self-model predicts
the intact robot, and no other does, ``unseen`` apart. ``ambiguous``: others cannot be told from it.
``unexplained``: it predicts significantly worse, or significantly worse than with a fault of a kind
that was not considered, so something is wrong that it does not say; only where a trial of the
intact robot is known."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis and how far its predictions are from the trials.

    Attributes:
        hypothesis: What may be wrong.
        distance: Sum over the trials of the comparator's distance; in the comparator's unit.
    """

    hypothesis: Hypothesis
    distance: float


@dataclass(frozen=True)
class UnsearchedFault:
    """A hypothesis with a fault that was not considered.

    Attributes:
        hypothesis: All that it says.
        kind: The name of the kind that was not considered.
    """

    hypothesis: Hypothesis
    kind: str

    def as_object(self) -> dict[str, str]:
        """Returns it as JSON has it."""
        return {"hypothesis": str(self.hypothesis), "kind": self.kind}


@dataclass(frozen=True)
class Diagnosis:
    """Hypotheses, best first.

    Attributes:
        ranked: At least one. The first is the best: the one with the fewest faults of which every
            one makes the prediction significantly better; where a comparator allows no such test,
            the closest. The others follow by distance; of equal distances the one with fewer faults
            comes first.
        trials: How many trials they had to explain.
        intact_distance: The distance that "nothing changed" gets.
        indistinguishable: Hypotheses not significantly worse than the best, closest first.
        unseen: The best hypothesis with one fault more, each that the trials neither show nor rule
            out, closest first, no more than are ranked; see ``unseen.undetectable``.
        verdict: Whether the best hypothesis explains the trials.
        test: By which test the rivals were told from the others.
        outside: The best hypothesis with a fault of a kind that was not considered, where that
            predicts the trials significantly better; see ``outside.best_unsearched_fault``.
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
        """The hypothesis that explains the trials best."""
        return self.ranked[0].hypothesis
