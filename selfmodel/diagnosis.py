"""A diagnosis: hypotheses ranked by how well they explain all trials."""

from dataclasses import dataclass

from selfmodel.hypothesis import Hypothesis


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
class Diagnosis:
    """Hypotheses, best first.

    Attributes:
        ranked: At least one; of equal distances the one with fewer faults comes first.
        trials: How many trials they had to explain.
    """

    ranked: tuple[Candidate, ...]
    trials: int

    @property
    def best(self) -> Hypothesis:
        """The hypothesis that explains the trials best."""
        return self.ranked[0].hypothesis
