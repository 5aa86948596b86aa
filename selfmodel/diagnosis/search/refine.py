"""Local search from good hypotheses to the one with the fewest faults that explains the trials.

The diagnostic EA finds the neighbourhood; this search tests every neighbour and keeps a fault only
where the trials require it. The whole algorithm:

1. **Starts**: the hypotheses found by the EA, the empty hypothesis, and the ``STARTS`` best single
   faults by the surrogate comparator, one per kind and part. Severities are those of the
   best levels by the surrogate (``severity.with_fitted_severities``), and they are pruned: most end
   in the same few hypotheses.
2. **Descent** over the neighbours with one fault more, replaced, or less: the surrogate selects
   ``SHORTLIST_SIZE`` of them, the comparator chooses the best, with its best levels, until the
   total loss falls no further, or a further fault does not improve it by ``MIN_Z_OF_STEP``. A
   hypothesis has at most ``max_faults`` faults.
3. **Pruning**: the fault whose removal costs least is removed, as long as the hypothesis with it is
   not significantly better (``significance.is_better``), or its gain is model error
   (``model_error.is_model_error``).
4. **Second descent** over the neighbours with one fault replaced, then pruning, until a hypothesis
   repeats. Every pruned hypothesis is a local optimum.
5. **Fit** of each local optimum's severities between the levels, and pruning again.
6. **Choice**: from the empty hypothesis on, in order of the number of faults and then of the total
   loss, a hypothesis replaces the current best only if it is significantly better. Its severities
   are fitted by the comparator itself, and it is pruned again.
7. **Mean severities** (``severity.with_mean_severities``), unless they make a fault prunable.

The surrogate comparator simulates a third of the segments (a tenth from three trials on), or the
first third of each trial. The measurements behind the significance levels are in ``significance``,
those behind the mean severity in ``severity``. No ablation of ``STARTS`` and ``SHORTLIST_SIZE`` is
on record.
"""

from collections.abc import Iterable, Sequence

from selfmodel.diagnosis.loss_functions import SHORTLIST_SIZE, LossFunctions, by_total_loss
from selfmodel.diagnosis.search.severity import with_fitted_severities, with_mean_severities
from selfmodel.diagnosis.verdicts.model_error import is_model_error
from selfmodel.diagnosis.verdicts.significance import is_better
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault

MIN_Z_OF_STEP = 2.0
"""Standard errors by which a further fault has to be better for a descent to continue. It is lower
than that of pruning, because another fault may be replaced afterwards. Without a bound, descents in
a wide space add faults that only pruning removes: ten times the simulations."""

PROMISING = 16
"""Faults that replace another, at most: so many of the best alone, and so many of the best added.
A fault that lowers the loss in neither way is not tried in the place of each fault."""

STARTS = 3
"""Single faults to start from, in addition to the known hypotheses."""


def refined(
    known: Iterable[Hypothesis], space: HypothesisSpace, max_faults: int, losses: LossFunctions
) -> Hypothesis:
    """Returns the best hypothesis in which every fault is required by the trials.

    The algorithm is in the docstring of the module.

    Args:
        known: Hypotheses to start from, in addition to the best single faults and ``INTACT``.
        space: The hypotheses about the robot; its coarse candidates are proposed.
        max_faults: Maximum number of faults of a hypothesis.
        losses: Loss functions of the trials.
    """
    search = _LocalSearch(space, max_faults, losses)
    proposed = dict.fromkeys([*known, INTACT, *search.best_single_faults()[:STARTS]])
    starts = dict.fromkeys(search.pruned(search.at_best_levels(start)) for start in proposed)
    local_optima = {optimum for start in starts for optimum in search.local_optima(start)}
    refits = {search.pruned(search.coarsely_fitted(optimum)) for optimum in local_optima}
    chosen = INTACT
    for hypothesis in sorted(refits, key=lambda one: (len(one), search.total_loss(one), one)):
        if search.is_better(hypothesis, chosen):
            chosen = hypothesis
    best = search.pruned(search.fitted(chosen))
    mean = with_mean_severities(best, losses.damaged, space)
    return mean if search.pruned(mean) == mean else best


class _LocalSearch:
    """Descents and pruning with the loss functions of one diagnosis."""

    def __init__(self, space: HypothesisSpace, max_faults: int, losses: LossFunctions) -> None:
        self._space, self._max_faults, self._losses = space, max_faults, losses
        self._ends: dict[Hypothesis, Hypothesis] = {}

    def total_loss(self, hypothesis: Hypothesis) -> float:
        return float(self._losses.damaged([hypothesis])[0].sum())

    def at_best_levels(self, hypothesis: Hypothesis) -> Hypothesis:
        return with_fitted_severities(hypothesis, self._losses.surrogate, self._space, zooms=0)

    def coarsely_fitted(self, hypothesis: Hypothesis) -> Hypothesis:
        return with_fitted_severities(hypothesis, self._losses.surrogate, self._space)

    def fitted(self, hypothesis: Hypothesis) -> Hypothesis:
        return with_fitted_severities(hypothesis, self._losses.damaged, self._space)

    def is_better(self, one: Hypothesis, other: Hypothesis) -> bool:
        return is_better(*self._losses.damaged([one, other]))

    def best_single_faults(self) -> list[Hypothesis]:
        """Single faults, best first by the surrogate, one severity per kind and part."""
        singles = self._allowed(self._space.with_one_more(INTACT))
        parts: dict[Fault, Hypothesis] = {}
        for single in by_total_loss(singles, self._losses.surrogate):
            (fault,) = single.faults
            parts.setdefault(Fault(fault.kind, fault.part), single)
        return list(parts.values())

    def local_optima(self, start: Hypothesis) -> list[Hypothesis]:
        """Pruned ends of successive descents from a start, until a hypothesis repeats.

        The descent over replacements is needed because a replaced fault may lower the loss more
        and correct no more than model error.
        """
        current = self.pruned(self._descended(start))
        optima = dict.fromkeys([current])
        while True:
            current = self.pruned(self._descended_by_replacement(current))
            if current in optima:
                return list(optima)
            optima[current] = None

    def pruned(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis after pruning: the fault whose removal costs least is removed first."""
        current = hypothesis
        while True:
            sufficient = [
                fewer
                for fewer in self._shortlist(self._space.with_one_less(current))
                if not self._is_required(current, fewer)
            ]
            if not sufficient:
                return current
            current = sufficient[0]

    def _descended(self, start: Hypothesis) -> Hypothesis:
        """The end of the descent over faults added, replaced and removed; known ends are kept."""
        passed, current = [], start
        while current not in self._ends:
            passed.append(current)
            more = self._by_surrogate(self._space.with_one_more(current))
            others = [*self._replaced(current, more), *self._space.with_one_less(current)]
            following = self._step(current, [*more[:SHORTLIST_SIZE], *others])
            if following is None:
                self._ends[current] = current
            else:
                current = following
        self._ends |= dict.fromkeys(passed, self._ends[current])
        return self._ends[current]

    def _descended_by_replacement(self, start: Hypothesis) -> Hypothesis:
        current = start
        while True:
            more = self._by_surrogate(self._space.with_one_more(current))
            following = self._step(current, self._replaced(current, more))
            if following is None:
                return current
            current = following

    def _step(self, current: Hypothesis, neighbours: Sequence[Hypothesis]) -> Hypothesis | None:
        """The best neighbour with its best levels; None if the descent ends."""
        best = self._shortlist(neighbours)
        if not best or not self._is_step(best[0], current):
            return None
        # The fit by the surrogate may raise the loss of the comparator.
        return min(best[0], self.at_best_levels(best[0]), key=self.total_loss)

    def _replaced(self, current: Hypothesis, more: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses with a promising fault in the place of one fault.

        Args:
            current: Hypothesis whose faults are replaced.
            more: The hypotheses with one fault more, best first.
        """
        singles = [single.faults[0] for single in self.best_single_faults()[:PROMISING]]
        added = [fault for one in more for fault in one.faults if fault not in current.faults]
        promising = dict.fromkeys([*singles, *added[:PROMISING]])
        faults = current.faults
        changed = [
            self._space.canonical([*faults[:i], *faults[i + 1 :], fault])
            for i in range(len(faults))
            for fault in promising
        ]
        return [one for one in dict.fromkeys(changed) if one != current]

    def _by_surrogate(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        return by_total_loss(self._allowed(hypotheses), self._losses.surrogate)

    def _is_step(self, one: Hypothesis, current: Hypothesis) -> bool:
        """Returns whether a descent continues: a further fault has to be worth its place."""
        if len(one) <= len(current):
            return self.total_loss(one) < self.total_loss(current)
        further, fewer = self._losses.damaged([one, current])
        return is_better(further, fewer, MIN_Z_OF_STEP)

    def _shortlist(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best hypotheses by the surrogate, sorted by the total loss of the comparator."""
        few = self._allowed(hypotheses)
        if len(few) > SHORTLIST_SIZE:
            few = by_total_loss(few, self._losses.surrogate)[:SHORTLIST_SIZE]
        return by_total_loss(few, self._losses.damaged)

    def _is_required(self, hypothesis: Hypothesis, fewer: Hypothesis) -> bool:
        """Returns whether the gain of the extra faults is significant and no model error."""
        return self.is_better(hypothesis, fewer) and not is_model_error(
            hypothesis, fewer, self._losses, self._space
        )

    def _allowed(self, hypotheses: Iterable[Hypothesis]) -> list[Hypothesis]:
        return [one for one in hypotheses if len(one) <= self._max_faults]
