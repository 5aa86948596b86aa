"""From a good hypothesis to the one with the fewest faults that explains the trials.

An EA finds the neighbourhood; here the neighbours are looked at one by one, and every fault has to
be worth its while.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from selfmodel.diagnosis.loss_functions import Losses, LossFunctions
from selfmodel.diagnosis.model_error import is_model_error
from selfmodel.diagnosis.severity import with_fitted_severities, with_mean_severities
from selfmodel.diagnosis.significance import is_better
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

SHORTLIST = 8
"""Hypotheses of many that are looked at closely."""

STARTS = 3
"""From how many of the best single faults a search begins, beside what is known already."""


def refined(
    known: Iterable[Hypothesis],
    faults: Sequence[Fault],
    most: int,
    looks: LossFunctions,
    anatomy: Anatomy,
) -> Hypothesis:
    """Returns the best hypothesis of which every fault is worth its while.

    From each start, the best change of one fault (one more, one less, another in its place) is
    made, and its degrees fitted, until none helps; then faults go that are not worth it. Of
    what the starts lead to, a hypothesis with more faults wins only where it is significantly
    better. Its degrees are the means of those that the trials cannot tell from the best.

    Args:
        known: Hypotheses to start from, beside the best single faults and ``INTACT``.
        faults: Those that may be proposed.
        most: Faults that a hypothesis may have.
        looks: How badly hypotheses predict the trials. Of many, those are looked at closely that
            the screen finds closest. A fault that would have helped as much before anything was
            wrong is not worth it: it mends the self-model.
        anatomy: The robot's parts.
    """
    search = _Search(faults, most, looks, anatomy)
    starts = dict.fromkeys([*known, INTACT, *_closest_parts(search)[:STARTS]])
    found = {end for start in starts for end in search.settled(search.fitted(start))}
    finest = {search.spared(search.fitted_finely(one)) for one in found}
    best = INTACT
    for hypothesis in sorted(finest, key=lambda one: (len(one), search.total(one), one)):
        if search.is_better(hypothesis, best):
            best = hypothesis
    mean = with_mean_severities(best, looks.after, anatomy)
    return mean if search.spared(mean) == mean else best


def _closest_parts(search: "_Search") -> list[Hypothesis]:
    """The single faults, closest first, each kind at each part at its best degree only."""
    singles = search.with_one_more(INTACT)
    parts: dict[tuple[FaultKind, str], Hypothesis] = {}
    for single in search.ordered(singles):
        (fault,) = single.faults
        parts.setdefault((fault.kind, fault.part), single)
    return list(parts.values())


def _ordered(hypotheses: Sequence[Hypothesis], losses: Losses) -> list[Hypothesis]:
    if not hypotheses:
        return []
    order = np.argsort(losses(hypotheses).sum(axis=1), kind="stable")
    return [hypotheses[i] for i in order]


class _Search:
    """Changes of one fault, and what they bring."""

    def __init__(
        self, faults: Sequence[Fault], most: int, looks: LossFunctions, anatomy: Anatomy
    ) -> None:
        self._faults, self._most, self._anatomy = faults, most, anatomy
        self._looks = looks

    def total(self, hypothesis: Hypothesis) -> float:
        return float(self._looks.after([hypothesis])[0].sum())

    def fitted(self, hypothesis: Hypothesis) -> Hypothesis:
        return with_fitted_severities(hypothesis, self._looks.screen, self._anatomy)

    def fitted_finely(self, hypothesis: Hypothesis) -> Hypothesis:
        return with_fitted_severities(hypothesis, self._looks.after, self._anatomy)

    def is_better(self, one: Hypothesis, other: Hypothesis) -> bool:
        return is_better(*self._looks.after([one, other]))

    def ordered(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The closest first, as the screen has it."""
        return _ordered(hypotheses, self._looks.screen)

    def closest(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Those that the screen lets through, the closest first."""
        few = hypotheses if len(hypotheses) <= SHORTLIST else self.ordered(hypotheses)[:SHORTLIST]
        return _ordered(few, self._looks.after)

    def settled(self, start: Hypothesis) -> list[Hypothesis]:
        """Where a search ends, no fault of which can be spared: by one more or less, then in place.

        Another fault in its place may predict better and mend no more than the model.
        """
        current = self.spared(self._descended(start, self._neighbours))
        ends = dict.fromkeys([current])
        while True:
            current = self.spared(self._descended(current, self._others_in_place))
            if current in ends:
                return list(ends)
            ends[current] = None

    def with_one_more(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        return self._distinct(hypothesis, [(*hypothesis.faults, fault) for fault in self._faults])

    def _descended(
        self, start: Hypothesis, neighbours: Callable[[Hypothesis], list[Hypothesis]]
    ) -> Hypothesis:
        current = start
        while True:
            best = self.closest(neighbours(current))
            if not best or self.total(best[0]) >= self.total(current):
                return current
            # The screen fits degrees; what it likes need not be better when looked at closely.
            current = min(best[0], self.fitted(best[0]), key=self.total)

    def spared(self, hypothesis: Hypothesis) -> Hypothesis:
        """Without the faults that make the prediction no better, the least useful first."""
        current = hypothesis
        while True:
            spared = [
                fewer
                for fewer in self.closest(self._with_one_less(current))
                if not self._is_worth_it(current, fewer)
            ]
            if not spared:
                return current
            current = spared[0]

    def _is_worth_it(self, hypothesis: Hypothesis, fewer: Hypothesis) -> bool:
        """Whether what a hypothesis says more than another tells what has changed."""
        return self.is_better(hypothesis, fewer) and not is_model_error(
            hypothesis, fewer, self._looks, self._anatomy
        )

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
        """Without one of the faults, or with a simpler one in its place, such as no angle."""
        faults = hypothesis.faults
        fewer = [faults[:i] + faults[i + 1 :] for i in range(len(hypothesis))]
        simpler = [
            (*faults[:i], dataclasses.replace(fault, severity=special), *faults[i + 1 :])
            for i, fault in enumerate(faults)
            if fault.severity not in fault.kind.alone
            for special in (*fault.kind.special, *fault.kind.alone)
        ]
        return self._distinct(hypothesis, [*fewer, *simpler])

    def _distinct(
        self, hypothesis: Hypothesis, changed: Iterable[tuple[Fault, ...]]
    ) -> list[Hypothesis]:
        made = dict.fromkeys(canonical(faults, self._anatomy) for faults in changed)
        return [one for one in made if one != hypothesis and len(one) <= self._most]
