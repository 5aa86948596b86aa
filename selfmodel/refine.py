"""From a good hypothesis to the one with the fewest faults that explains the trials.

An EA finds the neighbourhood; here the neighbours are looked at one by one, and every fault has to
be worth its while.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.arrays import FloatArray
from selfmodel.faults import Fault
from selfmodel.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.significance import is_better

Losses = Callable[[Sequence[Hypothesis]], FloatArray]
"""How badly hypotheses predict each piece of the trials, ``(n, pieces)``."""

STARTS = 3
"""From how many of the best single faults a search begins, beside what is known already."""


def refined(
    known: Iterable[Hypothesis],
    faults: Sequence[Fault],
    most: int,
    losses: Losses,
    anatomy: Anatomy,
) -> Hypothesis:
    """Returns the hypothesis with the fewest faults that no other predicts better than.

    From each start, the best change of one fault (one more, one less, another in its place) is
    made until none helps, then faults go that are not worth their while. Of what the starts lead
    to, a hypothesis with more faults wins only where it is significantly better.

    Args:
        known: Hypotheses to start from, beside the best single faults and ``INTACT``.
        faults: Those that may be proposed.
        most: Faults that a hypothesis may have.
        losses: How badly hypotheses predict the trials.
        anatomy: The robot's parts.
    """
    search = _Search(faults, most, losses, anatomy)
    singles = search.with_one_more(INTACT)
    starts = dict.fromkeys([*known, INTACT, *search.closest(singles, STARTS)])
    found = {search.settled(start) for start in starts}
    best = INTACT
    for hypothesis in sorted(found, key=lambda one: (len(one), search.total(one), one)):
        if search.is_better(hypothesis, best):
            best = hypothesis
    return best


class _Search:
    """Changes of one fault, and what they bring."""

    def __init__(
        self, faults: Sequence[Fault], most: int, losses: Losses, anatomy: Anatomy
    ) -> None:
        self._faults, self._most, self._losses, self._anatomy = faults, most, losses, anatomy

    def total(self, hypothesis: Hypothesis) -> float:
        return float(self._losses([hypothesis])[0].sum())

    def is_better(self, one: Hypothesis, other: Hypothesis) -> bool:
        return is_better(*self._losses([one, other]))

    def closest(self, hypotheses: Sequence[Hypothesis], count: int) -> list[Hypothesis]:
        if not hypotheses:
            return []
        order = np.argsort(self._losses(hypotheses).sum(axis=1), kind="stable")
        return [hypotheses[i] for i in order[:count]]

    def settled(self, start: Hypothesis) -> Hypothesis:
        """Where a search ends: no change helps, and no fault can be spared."""
        current = self._descended(start, self._neighbours)
        while True:
            spared = self._spared(current)
            again = self._descended(spared, self._others_in_place)
            if again in (current, spared):
                return self._spared(again)
            current = again

    def with_one_more(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        return self._distinct(hypothesis, [(*hypothesis.faults, fault) for fault in self._faults])

    def _descended(
        self, start: Hypothesis, neighbours: Callable[[Hypothesis], list[Hypothesis]]
    ) -> Hypothesis:
        current = start
        while True:
            best = self.closest(neighbours(current), 1)
            if not best or self.total(best[0]) >= self.total(current):
                return current
            current = best[0]

    def _spared(self, hypothesis: Hypothesis) -> Hypothesis:
        """Without the faults that make the prediction no better, the least useful first."""
        current = hypothesis
        while True:
            spared = [
                fewer
                for fewer in self.closest(self._with_one_less(current), self._most)
                if not self.is_better(current, fewer)
            ]
            if not spared:
                return current
            current = spared[0]

    def _neighbours(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        return (
            self.with_one_more(hypothesis)
            + self._others_in_place(hypothesis)
            + self._with_one_less(hypothesis)
        )

    def _others_in_place(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        return self._distinct(
            hypothesis,
            [
                (*hypothesis.faults[:i], *hypothesis.faults[i + 1 :], fault)
                for i in range(len(hypothesis))
                for fault in self._faults
            ],
        )

    def _with_one_less(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        faults = hypothesis.faults
        return self._distinct(
            hypothesis, [faults[:i] + faults[i + 1 :] for i in range(len(hypothesis))]
        )

    def _distinct(
        self, hypothesis: Hypothesis, changed: Iterable[tuple[Fault, ...]]
    ) -> list[Hypothesis]:
        made = dict.fromkeys(canonical(faults, self._anatomy) for faults in changed)
        return [one for one in made if one != hypothesis and len(one) <= self._most]
