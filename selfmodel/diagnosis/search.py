"""The search for the best hypothesis: the diagnostic EA, and a local search from its best.

``Settings.diagnostic_search`` has the EA alone (``ea``), the local search alone (``stepwise``), or
the local search from the best of the EA. The EA (the paper, section III) finds the neighbourhood.
The local search tests every neighbour and keeps a fault only where the trials require it; with
losses of many short segments it finds the same hypothesis from nearly every start. A comparator
with one distance per trial has no paired test: a hypothesis is then better than another whose sum
of distances is 10 % larger. The local search:

1. **Starts**: the best hypotheses of the EA or of the last diagnosis, the empty hypothesis, and the
   ``STARTS`` best single faults by the surrogate comparator, one per kind and part. Severities are
   those of the best levels by the surrogate (``with_fitted_severities``), and they are pruned: most
   end in the same few hypotheses. Where joints stand under commands, the hypotheses that stop them
   are the only starts, if the trials require them.
2. **Descent** over the neighbours with one fault more, replaced, or less: the surrogate selects
   ``SHORTLIST_SIZE`` of them, the comparator chooses the best, with its best levels, until the
   total loss falls no further, or a further fault does not improve it by ``MIN_Z_OF_STEP``. A
   hypothesis has at most as many faults as a genome has genes.
3. **Pruning**: the fault whose removal costs least is removed, as long as the hypothesis with it is
   not significantly better (``significance.is_better``) nor told by a healthy trial of the same
   movement (``Problem.contrast``), or its gain is model error (``is_model_error``).
4. **Second descent** over the neighbours with one fault replaced, then pruning, until a hypothesis
   repeats. Every pruned hypothesis is a local optimum.
5. **Fit** of each local optimum's severities between the levels, and pruning again.
6. **Choice**: from the empty hypothesis on, in order of the number of faults and then of the total
   loss, a hypothesis replaces the current best only if it is significantly better. Its severities
   are fitted by the comparator itself (but for a long trial), and it is pruned again.
7. **Mean severities** (``with_mean_severities``), unless they make a fault prunable.

The surrogate comparator simulates a third of the segments of a short trial, and as much of a longer
one (a tenth from three trials on), or the first third of each trial. No ablation of ``STARTS`` and
``SHORTLIST_SIZE`` is on record.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from itertools import combinations

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis import significance
from selfmodel.diagnosis.losses import LossFunction, by_total_loss
from selfmodel.diagnosis.problem import Problem
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import GENE_VALUES, HypothesisSpace
from selfmodel.faults.kind import Fault
from selfmodel.progress import followed
from selfmodel.settings import Settings

Neighbours = Callable[[Hypothesis], list[Hypothesis]]
"""Returns hypotheses near another one."""

STARTS = 3
"""Single faults to start from, in addition to the known hypotheses."""

SHORTLIST_SIZE = 8
"""Hypotheses that pass from the surrogate comparator to the comparator itself."""

PROMISING = 16
"""Faults that replace another, at most: so many of the best alone, and so many of the best added.
A fault that lowers the loss in neither way is not tried in the place of each fault."""

ZOOM_POINTS, ZOOMS, MAX_ROUNDS = 7, 2, 2
"""Severities per zoom, zooms per fault, and passes over all faults of a hypothesis."""

SEVERITY_DECIMALS = 4
"""Decimals of a fitted severity."""

ONE_ERROR = math.exp(-1 / 2)
"""Weight of a severity whose loss is a standard error above the best."""


def evolved(
    distances: Callable[[Sequence[Hypothesis]], FloatArray],
    space: HypothesisSpace,
    settings: Settings,
    seeds: Sequence[Hypothesis],
    rng: np.random.Generator,
    *,
    on_generation: GenerationCallback,
) -> tuple[list[Hypothesis], int]:
    """Returns the hypotheses that the diagnostic EA evaluated, best first, and their evaluations.

    Fitness is minus the distance from all trials, ``(n,)``. The seeds are in the initial
    population, beside random hypotheses. Source: the paper, section III.
    """
    totals: dict[Hypothesis, float] = {}

    def fitness(genomes: FloatArray) -> FloatArray:
        hypotheses = [space.decode(genome) for genome in genomes]
        values = distances(hypotheses)
        totals.update(zip(hypotheses, map(float, values), strict=True))
        return 0.0 - values  # not -values: a perfect fitness is 0, not -0

    search = Evolution(
        settings.genes * GENE_VALUES,
        settings,
        rng,
        [space.encode(hypothesis, settings.genes) for hypothesis in seeds],
        draw=np.random.Generator.random,
    )
    evolve(search, fitness, on_generation, search.generations_left)
    return by_distance(totals), search.evaluations


def by_distance(totals: Mapping[Hypothesis, float]) -> list[Hypothesis]:
    """Returns hypotheses by their distance; at equal distances, by their number of faults."""
    return sorted(totals, key=lambda one: (totals[one], len(one), one))


class LocalSearch:
    """Descents and pruning on one problem; the algorithm is in the docstring of the module.

    Attributes:
        compared: Hypotheses that were compared with the trials.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.compared: set[Hypothesis] = set()
        self._space, self._max_faults = problem.space, problem.settings.genes

    def losses(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses on the trials, ``(n, pieces)``; the hypotheses count as compared."""
        self.compared.update(hypotheses)
        return self.problem.losses(hypotheses)

    def coarse(self, hypotheses: Sequence[Hypothesis]) -> FloatArray:
        """Returns the losses by the surrogate."""
        return self.problem.coarse(hypotheses)

    def refined(self, known: Iterable[Hypothesis]) -> Hypothesis:
        """Returns the best hypothesis in which every fault is required by the trials.

        The search starts from the known ones, the best single faults and ``INTACT``; or from the
        known ones alone if joints stand under commands, and the trials require one of them. Those
        that predict the trials as well as ``INTACT`` predicts the healthy ones are compared by few
        neighbours; a dead sensor may be beside the best of them all the same.
        """
        fitted = partial(with_fitted_severities, space=self._space)
        levels = partial(fitted, losses=self.coarse, zooms=0)
        step = partial(followed, stage="refinement", observer=self.problem.observer, parts=3)
        proposed = [*dict.fromkeys(known)]
        starts = dict.fromkeys(self.pruned(levels(start)) for start in step(proposed, before=0))
        if not (self.problem.standing and any(starts)):
            further = [INTACT, *self.best_single_faults[:STARTS]]
            starts |= dict.fromkeys(self.pruned(levels(start)) for start in further)
        evident = [start for start in starts if self.problem.suffices(start)]
        local_optima = (
            {self._beside(evident)}
            if evident
            else {one for start in step([*starts], before=1) for one in self.local_optima(start)}
        )
        refits = {
            self.pruned(fitted(optimum, losses=self.coarse))
            for optimum in step([*local_optima], before=2)
        }
        contrasting = filter(self._contrasts, refits)
        best = chosen_of(refits, self.losses) or min(
            contrasting, key=lambda one: (self.total_loss(one), one), default=INTACT
        )
        if not self.problem.is_long:  # the mean is of a grid around the fit by the surrogate
            best = fitted(best, losses=self.losses)
        best = self.pruned(best)
        mean = with_mean_severities(best, self.losses, self._space)
        return mean if self.pruned(mean) == mean else best

    def total_loss(self, hypothesis: Hypothesis) -> float:
        """Returns the sum of the losses of a hypothesis on the trials."""
        return float(self.losses([hypothesis])[0].sum())

    @cached_property
    def best_single_faults(self) -> list[Hypothesis]:
        """Single faults, best first by the surrogate, one severity per kind and part."""
        parts: dict[Fault, Hypothesis] = {}
        for single in self._by_surrogate(self._space.with_one_more(INTACT)):
            (fault,) = single.faults
            parts.setdefault(Fault(fault.kind, fault.part), single)
        return list(parts.values())

    @property
    def best_alone(self) -> Hypothesis:
        """The best of the empty hypothesis and the first single faults, at their best levels."""
        singles = [
            with_fitted_severities(single, self.coarse, self._space, zooms=0)
            for single in self.best_single_faults[:STARTS]
        ]
        return self._shortlist(list(dict.fromkeys([INTACT, *singles])))[0]

    def local_optima(self, start: Hypothesis) -> list[Hypothesis]:
        """Pruned ends of successive descents from a start, until a hypothesis repeats.

        The descent over replacements is needed because a replaced fault may lower the loss more
        and correct no more than model error.
        """
        current = self.pruned(self._descended(start, self._neighbours))
        optima: list[Hypothesis] = []
        while current not in optima:
            optima.append(current)
            current = self.pruned(self._descended(current, self._replaced))
        return optima

    def pruned(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis after pruning: the fault whose removal costs least is removed first."""
        for fewer in self._shortlist(self._space.with_one_less(hypothesis)):
            if not self._is_required(hypothesis, fewer):
                return self.pruned(fewer)
        return hypothesis

    def _descended(self, start: Hypothesis, neighbours: Neighbours) -> Hypothesis:
        """The end of the descent from a start over neighbours."""
        current: Hypothesis | None = start
        while current is not None:
            start, current = current, self._step(current, neighbours(current))
        return start

    def _neighbours(self, current: Hypothesis) -> list[Hypothesis]:
        """The hypotheses with one fault more (the best), replaced or less."""
        more = self._with_one_more(current)[:SHORTLIST_SIZE]
        return [*more, *self._replaced(current), *self._space.with_one_less(current)]

    def _step(self, current: Hypothesis, neighbours: Sequence[Hypothesis]) -> Hypothesis | None:
        """The best neighbour with its best levels; None if the descent ends."""
        best, *_ = self._shortlist(neighbours) or [current]
        if best == current or not self._is_step(best, current):
            return None
        # The fit by the surrogate may raise the loss of the comparator.
        fitted = with_fitted_severities(best, self.coarse, self._space, zooms=0)
        return min(best, fitted, key=self.total_loss)

    def _replaced(self, current: Hypothesis) -> list[Hypothesis]:
        """The hypotheses with a promising fault in the place of one fault."""
        more = self._with_one_more(current)
        added = [fault for one in more for fault in one.faults if fault not in current.faults]
        singles = [single.faults[0] for single in self.best_single_faults[:PROMISING]]
        return self._exchanged(current, [*singles, *added[:PROMISING]])

    def _beside(self, evident: Sequence[Hypothesis]) -> Hypothesis:
        """The best of some hypotheses by which joints stand, and what is beside it, pruned."""
        parts = self.problem.standing_parts

        def others(current: Hypothesis) -> list[Hypothesis]:
            standing = [one for one in self._space.coarse_candidates if one.part in parts]
            return self._exchanged(current, standing)

        def neighbours(current: Hypothesis) -> list[Hypothesis]:
            more = self._by_surrogate(self._space.with_one_more(current))[:SHORTLIST_SIZE]
            return [*more, *others(current)]

        best = min((self._descended(one, others) for one in evident), key=self.total_loss)
        return self.pruned(self._descended(best, neighbours))

    def _exchanged(self, current: Hypothesis, others: Sequence[Fault]) -> list[Hypothesis]:
        """The hypotheses with one of some other faults in the place of one fault."""
        faults, promising = current.faults, dict.fromkeys(others)
        changed = [
            self._space.canonical([*faults[:i], *faults[i + 1 :], fault])
            for i in range(len(faults))
            for fault in promising
        ]
        return [one for one in dict.fromkeys(changed) if one != current]

    def _with_one_more(self, current: Hypothesis) -> list[Hypothesis]:
        """The hypotheses with one fault more that is not hopeless, best first by the surrogate."""
        known = {*current.faults, *self.hopeless(self._space.with_one_more(INTACT))}
        more = self._space.with_one_more(current)
        return self._by_surrogate([one for one in more if not known.issuperset(one.faults)])

    def hopeless(self, singles: Sequence[Hypothesis]) -> set[Fault]:
        """Returns the faults that alone have ``LOSS_RATIO`` times the loss of none.

        The losses are those of the surrogate.
        """
        intact, *rows = self.coarse([INTACT, *singles])
        limit = significance.LOSS_RATIO * intact.mean() + significance.NEGLIGIBLE_LOSS
        return {
            fault
            for single, row in zip(singles, rows, strict=True)
            if row.mean() > limit
            for fault in single.faults
        }

    def _by_surrogate(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        return by_total_loss(self._allowed(hypotheses), self.coarse)

    def _is_step(self, one: Hypothesis, current: Hypothesis) -> bool:
        """Returns whether a descent continues: a further fault has to be worth its place."""
        if len(one) <= len(current):
            return self.total_loss(one) < self.total_loss(current)
        further, fewer = self.losses([one, current])
        return significance.is_better(further, fewer, significance.MIN_Z_OF_STEP)

    def _shortlist(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best hypotheses by the surrogate, sorted by the total loss of the comparator."""
        few = self._allowed(hypotheses)
        if len(few) > SHORTLIST_SIZE:
            few = by_total_loss(few, self.coarse)[:SHORTLIST_SIZE]
        return by_total_loss(few, self.losses)

    def _is_required(self, hypothesis: Hypothesis, fewer: Hypothesis) -> bool:
        """Returns whether the gain of the extra faults is significant and no model error."""
        is_gain = significance.is_better(*self.losses([hypothesis, fewer]))
        return (is_gain or self._contrasts(hypothesis)) and not is_model_error(
            hypothesis, fewer, self.problem
        )

    def _contrasts(self, hypothesis: Hypothesis) -> bool:
        return self.problem.contrast(hypothesis) >= significance.MIN_Z_ACROSS_TRIALS

    def _allowed(self, hypotheses: Iterable[Hypothesis]) -> list[Hypothesis]:
        return [one for one in hypotheses if len(one) <= self._max_faults]


def chosen_of(hypotheses: Iterable[Hypothesis], losses: LossFunction) -> Hypothesis:
    """Returns the hypothesis with the fewest faults, each of which is a significant gain."""
    chosen, totals = INTACT, {one: float(losses([one])[0].sum()) for one in hypotheses}
    for hypothesis in sorted(totals, key=lambda one: (len(one), totals[one], one)):
        if significance.is_better(*losses([hypothesis, chosen])):
            chosen = hypothesis
    return chosen


def is_model_error(hypothesis: Hypothesis, fewer: Hypothesis, problem: Problem) -> bool:
    """Returns whether extra faults improve the healthy trials about as much as the damaged ones.

    The result is False if there are no comparable healthy trials.
    """
    extra = [fault for fault in hypothesis.faults if fault not in fewer.faults]
    healthy = problem.healthy([problem.space.canonical(extra), INTACT])
    # Most faults worsen the healthy trials; their losses on the damaged trials are not needed.
    if healthy is None or not healthy[0].mean() < healthy[1].mean():
        return False
    return significance.gain_is_model_error(*problem.losses([hypothesis, fewer]), *healthy)


def any_fault_is_model_error(hypothesis: Hypothesis, problem: Problem) -> bool:
    """Returns whether at least one fault of a hypothesis corrects model error."""
    return any(
        is_model_error(hypothesis, problem.space.canonical(rest), problem)
        for rest in combinations(hypothesis.faults, max(len(hypothesis) - 1, 0))
    )


def with_fitted_severities(
    hypothesis: Hypothesis, losses: LossFunction, space: HypothesisSpace, zooms: int = ZOOMS
) -> Hypothesis:
    """Returns the hypothesis with the severities of the lowest total loss, by coordinate descent.

    ``zooms`` is the number of grids between levels; 0 for the best levels.
    """
    current = hypothesis
    for _ in range(MAX_ROUNDS):
        before = current
        for index in range(len(current)):
            if index < len(current):  # a fault with a nominal severity was dropped
                current = with_fitted_severity(current, index, losses, space, zooms)
        if current == before:
            break
    return current


def with_fitted_severity(
    hypothesis: Hypothesis,
    index: int,
    losses: LossFunction,
    space: HypothesisSpace,
    zooms: int = ZOOMS,
) -> Hypothesis:
    """Returns the hypothesis with the severity of one fault of the lowest total loss.

    It is the best of the kind's levels, then of ``zooms`` grids, each between the neighbours of the
    best severity so far.
    """
    fault = hypothesis.faults[index]
    bounds = space.severity_bounds(fault)
    if bounds is None:
        return hypothesis
    severities = [fault.severity, *space.levels(fault)]
    # A kind that edits the specification has no severities between its levels: each severity
    # needs a compiled model.
    for _ in range(1 if fault.kind.edits_specification else 1 + zooms):
        tried = [space.with_severity(hypothesis, index, severity) for severity in severities]
        chosen = int(np.argmin(losses(tried).sum(axis=1)))
        severity, best = severities[chosen], tried[chosen]
        severities = [severity, *_around(severity, severities, bounds)]
    return best


def with_mean_severities(
    hypothesis: Hypothesis, losses: LossFunction, space: HypothesisSpace
) -> Hypothesis:
    """Returns the hypothesis with severities averaged over those that the trials do not rule out.

    The loss is nearly flat around its minimum and rugged, so the position of the minimum is random.
    With one seed and a true friction of 0.4, hardly any friction from 0.31 to 0.41 was a standard
    error worse than another, 0.31 had the lowest loss, and the mean is 0.36. A severity whose loss
    is z standard errors above the best, paired over the pieces, has the weight exp(-z^2 / 2).
    Severities beyond a ruled-out severity have no weight. Of a severity below the lowest level but
    0, that level stands, as of a motor without torque, unless the best is a standard error better:
    every mean is above it, and a leg with a hundredth of a servo's gain is not limp.
    """
    current = hypothesis
    for index in range(len(hypothesis)):
        mean = _averaged(current, index, losses, space)
        if len(mean) == len(current) and not significance.is_better(*losses([current, mean])):
            current = mean
    return current


def _averaged(
    hypothesis: Hypothesis, index: int, losses: LossFunction, space: HypothesisSpace
) -> Hypothesis:
    fault = hypothesis.faults[index]
    bounds = space.severity_bounds(fault)
    if bounds is None or fault.kind.edits_specification:
        return hypothesis
    levels = space.levels(fault)
    severities = sorted({fault.severity, *levels, *_around(fault.severity, levels, bounds)})
    if len(severities) == 1:
        return hypothesis
    rows = losses([space.with_severity(hypothesis, index, severity) for severity in severities])
    weights = _weights(rows)
    is_least = 0.0 in levels and fault.severity < min(filter(None, levels), default=0.0)
    if is_least and weights[severities.index(0.0)] > ONE_ERROR:
        return space.with_severity(hypothesis, index, 0.0)
    # Integrals, because severities are denser around the best.
    mean = np.trapezoid(weights * severities, severities) / np.trapezoid(weights, severities)
    return space.with_severity(hypothesis, index, round(float(mean), SEVERITY_DECIMALS))


def _weights(rows: FloatArray) -> FloatArray:
    """Weights of ascending severities, ``(n,)``; 0 from the first ruled-out one on either side."""
    best = int(np.argmin(rows.sum(axis=1)))
    z = np.array(
        [significance.paired_z(row, rows[best]) if np.isfinite(row).all() else 0.0 for row in rows]
    )
    worse = rows.mean(axis=1) > rows[best].mean() + significance.NEGLIGIBLE_LOSS
    out = np.array([significance.is_better(rows[best], row) for row in rows]) | (worse & (z <= 0))
    low = max(np.flatnonzero(out[:best]), default=-1)
    high = best + min(np.flatnonzero(out[best:]), default=len(out))
    weights: FloatArray = np.exp(-np.square(z) / 2)
    weights[: low + 1] = weights[high:] = 0.0
    return weights


def _around(severity: float, known: Sequence[float], bounds: tuple[float, float]) -> list[float]:
    """A grid from the next smaller known severity to the next larger one, or to the bounds."""
    low = max((other for other in known if other < severity), default=bounds[0])
    high = min((other for other in known if other > severity), default=bounds[1])
    grid: list[float] = np.linspace(low, high, ZOOM_POINTS).round(SEVERITY_DECIMALS).tolist()
    return grid
