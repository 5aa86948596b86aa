"""Alternatives to the best hypothesis: indistinguishable, undetectable and unsearched faults.

They come from the neighbourhood of the best hypothesis, whatever the search compared; those that
were passed over are the search's.
"""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from selfmodel.diagnosis import search, significance
from selfmodel.diagnosis.adequacy import supported
from selfmodel.diagnosis.diagnosis import DetectableSeverity, UnsearchedFault
from selfmodel.diagnosis.joints import lead_at_joints
from selfmodel.diagnosis.losses import LossFunction, by_total_loss
from selfmodel.diagnosis.problem import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.progress import Observer, followed, ignore

UNTOLD = 0.5
"""Share of the loss of an intact robot with which a fault is not passed over: where a robot lies
from the first second on, few pieces tell. Of 315 healthy recordings that were found intact, the
best of all hypotheses had 0.60 to 1; a dead motor that was missed, 0.39."""


def leads_of(best: Hypothesis, problem: Problem) -> dict[Hypothesis, float]:
    """Returns by how many standard errors the best hypothesis predicts better than its neighbours.

    The neighbours have one fault less than the best, or another fault of the searched kinds in the
    place of one of its faults, or are single faults or none; they have at most as many faults.
    Where the best stops joints that stand, another fault in the place of one of these is of the
    same limbs. The eight best by the surrogate are compared, with the severity of the other fault
    fitted, and the empty hypothesis. The lead is that of the loss, or that at a joint at which the
    two differ; infinite over a neighbour of whose faults one corrects model error. They are sorted
    by total loss.
    """
    space = problem.space
    neighbours = dict.fromkeys(
        [*space.with_one_less(best), *space.with_one_replaced(best), *space.with_one_more(INTACT)]
    )
    parts = problem.standing_parts if problem.suffices(best) else frozenset()

    def is_rival(one: Hypothesis) -> bool:
        lost, new = (
            {fault.part for fault in some.lacking(other)}
            for some, other in ((best, one), (one, best))
        )
        may_stand = not new or parts.isdisjoint(lost) or not parts.isdisjoint(new)
        return len(one) <= len(best) and bool(lost) and may_stand

    rivals = [*filter(is_rival, neighbours)]
    few = best_severities(by_total_loss(rivals, problem.coarse))[: search.SHORTLIST_SIZE]
    fitted = [
        _with_fitted_others(one, best, problem)
        for one in followed(few, "alternatives", problem.observer)
    ]
    others = [*filter(is_rival, dict.fromkeys([*few, *fitted, INTACT]))]
    leads = {}
    for one in by_total_loss(others, problem.losses):
        own, other, intact = problem.losses([best, one, INTACT])
        lead = significance.lead(own, other)
        if np.array_equal(other, intact):  # the empty one, and faults without an effect
            lead = max(lead, problem.contrast(best))
        if problem.has_joints:
            lead = max(lead, lead_at_joints(best, one, problem))
        if lead < significance.MIN_Z and search.any_fault_is_model_error(one, problem):
            lead = math.inf
        leads[one] = lead
    return leads


def indistinguishable(leads: Mapping[Hypothesis, float]) -> list[Hypothesis]:
    """Returns the neighbours over which the best hypothesis has no significant lead.

    Of those that differ in severities alone, there is the one with the smallest loss.
    """
    return best_severities(one for one, lead in leads.items() if lead < significance.MIN_Z)


def passed_over(compared: Sequence[Hypothesis], problem: Problem) -> Hypothesis | None:
    """Returns the fewest faults that halve the loss of an intact robot without a significant lead.

    None if there are none, if the loss is as good as 0, or if healthy trials gain from them too.
    They are of the hypotheses that a search compared, those with the smallest distances first.
    """
    intact, *rows = problem.losses([INTACT, *compared])
    untold = [
        one
        for one, row in zip(compared, rows, strict=True)
        if intact.mean() > significance.LOSS_FLOOR
        and row.mean() <= UNTOLD * intact.mean()
        and not significance.is_better(row, intact)
        and ((healthy := problem.healthy([one, INTACT])) is None or np.diff(healthy.mean(1)) <= 0)
    ]
    return min(untold, key=len, default=None)


def _with_fitted_others(one: Hypothesis, best: Hypothesis, problem: Problem) -> Hypothesis:
    """Returns a neighbour with the severities fitted of the faults that the best lacks.

    A neighbour that is far from the best by the surrogate stays as it is: no fit makes up for it.
    """
    best_losses, losses = problem.coarse([best, one])
    if losses.mean() > significance.LOSS_RATIO * best_losses.mean() + significance.NEGLIGIBLE_LOSS:
        return one
    for fault in one.faults:
        if fault not in best.faults and fault in one.faults:
            index = one.faults.index(fault)
            one = search.with_fitted_severity(one, index, problem.coarse, problem.space)
    return one


def best_severities(hypotheses: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Returns the first of the hypotheses that differ in severities alone, in the same order."""
    first: dict[frozenset[tuple[FaultKind, str]], Hypothesis] = {}
    for one in hypotheses:
        first.setdefault(one.without_severities, one)
    return list(first.values())


def undetectable(best: Hypothesis, problem: Problem) -> list[Hypothesis]:
    """Returns the best hypothesis with one fault more, for each fault that does not show.

    Added to the best hypothesis, an undetectable fault changes the loss significantly in neither
    direction. An example is a dead touch sensor in a foot that the gait never puts down. Kinds with
    severities are excluded: most have a severity that is too small to detect. Hypotheses that the
    surrogate comparator distinguishes from the best are not simulated further. The others are
    sorted by total loss.
    """
    space = problem.space
    faults = [fault for fault in space.coarse_candidates if fault.kind.bounds is None]
    distinct = dict.fromkeys(space.canonical([*best.faults, fault]) for fault in faults)
    candidates = [one for one in distinct if len(one) > len(best)]
    for losses in (problem.coarse, problem.losses):
        best_losses, *rows = losses([best, *candidates])
        candidates = [
            one
            for one, row in zip(candidates, rows, strict=True)
            if np.isfinite(best_losses).all()
            and not significance.is_better(best_losses, row)
            and not significance.is_better(row, best_losses)
        ]
    return by_total_loss(candidates, problem.losses)


def unsearched_fault(best: Hypothesis, problem: Problem) -> UnsearchedFault | None:
    """Returns the best hypothesis with one fault of an unsearched kind, if significantly better.

    One fault of a built-in kind is added to the best hypothesis, or replaces all faults of the same
    part. The gain has to be significant, and significantly larger than the gain of the fault alone
    on healthy trials; otherwise the fault corrects model error. Of those that pass, the one with
    the lowest total loss is returned, with the best hypothesis of each other kind; None if there is
    none, or if there are no comparable healthy trials.
    """
    (best_losses,) = problem.losses([best])
    is_exact = (
        not np.isfinite(best_losses).all() or best_losses.mean() <= significance.NEGLIGIBLE_LOSS
    )
    if problem.healthy([INTACT]) is None or is_exact:
        return None
    faults = _with_unsearched(best, problem.space)
    better: dict[str, Hypothesis] = {}
    for candidate in _largest_gains(best, faults, problem):
        fault, losses = faults[candidate], problem.losses([candidate])[0]
        # Most are no gain: what they do to the healthy trials is not needed.
        if fault.kind.name in better or not significance.is_gain(losses, best_losses):
            continue
        healthy = problem.healthy([problem.space.canonical([fault]), INTACT])
        if healthy is None:
            continue
        is_gain = significance.gain_exceeds_healthy_gain(losses, best_losses, *healthy)
        if is_gain and fault not in candidate.lacking(supported(candidate, problem)[0]):
            better[fault.kind.name] = candidate
    if not better:
        return None
    (first, hypothesis), *others = better.items()
    return UnsearchedFault(hypothesis, first, dict(others))


def _with_unsearched(best: Hypothesis, space: HypothesisSpace) -> dict[Hypothesis, Fault]:
    """Returns hypotheses with a fault of an unsearched kind, each with that fault.

    Kinds that edit the specification, such as rough terrain, are excluded: each hypothesis needs a
    compiled model. So are kinds that do not suit the robot, such as wind on a bench.
    """
    suited = [kind for kind in ALL_KINDS if kind.suits(space.anatomy)]
    kinds = [kind for kind in suited if kind not in space.kinds and not kind.edits_specification]
    unsearched: dict[Hypothesis, Fault] = {}
    for fault in replace(space, kinds=tuple(kinds)).coarse_candidates:
        others = [other for other in best.faults if other.part != fault.part]
        for faults in ((*best.faults, fault), (*others, fault)):
            unsearched.setdefault(space.canonical(faults), fault)
    unsearched.pop(best, None)
    return unsearched


def _largest_gains(
    best: Hypothesis, faults: Mapping[Hypothesis, Fault], problem: Problem
) -> list[Hypothesis]:
    """The most significant gains by the surrogate, sorted by total loss of the comparator.

    Of each fault on each side of its nominal severity, the mildest is first; a severity beyond one
    that predicts the trials significantly worse is assumed to be worse.
    """
    sides: dict[Hashable, list[Hypothesis]] = {}
    for own, fault in sorted(faults.items(), key=lambda one: _distance_from_nominal(one[1])):
        nominal, others = fault.kind.nominal, frozenset(own.faults) - {fault}
        side = (fault.kind, fault.part, fault.severity > (nominal or 0.0), others)
        sides.setdefault(own if nominal is None else side, []).append(own)
    z: dict[Hypothesis, float] = {}
    left = [*sides.values()]
    while left:
        mildest = [own[0] for own in left]
        best_losses, *rows = problem.coarse([best, *mildest])
        for own, row in zip(mildest, rows, strict=True):
            is_finite = np.isfinite([best_losses, row]).all()
            z[own] = significance.paired_z(best_losses, row) if is_finite else -np.inf
        left = [
            own[1:]
            for own, row in zip(left, rows, strict=True)
            if own[1:] and not significance.is_better(best_losses, row)
        ]
    tried = [own for own in faults if own in z]
    order = np.argsort([z[own] for own in tried], kind="stable")[::-1]
    return by_total_loss([tried[i] for i in order[: search.SHORTLIST_SIZE]], problem.losses)


def _distance_from_nominal(fault: Fault) -> float:
    return abs(fault.severity - (fault.kind.nominal or 0.0))


def detectable_severities(
    best: Hypothesis, space: HypothesisSpace, losses: LossFunction, observer: Observer = ignore
) -> list[DetectableSeverity]:
    """Returns the smallest detectable severities of every kind with a nominal severity.

    The nominal friction is the model's; the level with the smallest loss is taken for it. Parts
    with a fault in the best hypothesis are left out. A severity beyond one that shows is assumed to
    show too, so that a bisection over the kind's levels finds the limit. A fault shows if it
    predicts the trials worse by ``MIN_Z_ACROSS_TRIALS`` standard errors: a diagnosis requires
    ``MIN_Z``, but the losses of a trial with the fault are not known. On the log of a real robot,
    weaknesses with ``MIN_Z`` were found in half of the cases.
    """
    faulty = {fault.part for fault in best.faults}
    faults = [
        Fault(kind, part)
        for kind in space.kinds
        if kind.bounds is not None and not kind.edits_specification
        for part in space.parts(kind)
        if part not in faulty
    ]
    sides: list[tuple[Fault, list[float]]] = []
    for fault in faults:
        nominal = _nominal(fault, best, space, losses)
        if nominal is not None:
            levels = sorted(space.levels(fault))
            below = [level for level in reversed(levels) if level < nominal]
            above = [level for level in levels if level > nominal]
            # The nearest level is preceded by half of it.
            sides += [
                (fault, [(nominal + side[0]) / 2, *side] if side else []) for side in (below, above)
            ]
    low, high = [0 for _ in sides], [len(severities) for _, severities in sides]
    rounds = range(max(high, default=0).bit_length())
    for _ in followed(rounds, "detectable severities", observer):
        undecided = [i for i in range(len(sides)) if low[i] < high[i]]
        middles = {i: (low[i] + high[i]) // 2 for i in undecided}
        tried = [replace(sides[i][0], severity=sides[i][1][k]) for i, k in middles.items()]
        candidates = [space.canonical([*best.faults, fault]) for fault in tried]
        best_losses, *rows = losses([best, *candidates])
        for (i, middle), row in zip(middles.items(), rows, strict=True):
            if significance.is_better(best_losses, row, significance.MIN_Z_ACROSS_TRIALS):
                high[i] = middle
            else:
                low[i] = middle + 1
    smallest = [(*severities, None)[i] for (_, severities), i in zip(sides, high, strict=True)]
    return [
        DetectableSeverity(fault.kind.name, fault.part, below, above)
        for (fault, _), below, above in zip(sides[::2], smallest[::2], smallest[1::2], strict=True)
    ]


def _nominal(
    fault: Fault, best: Hypothesis, space: HypothesisSpace, losses: LossFunction
) -> float | None:
    """Returns the severity at which a fault has no effect; None if the kind has none."""
    if fault.kind.nominal is not None or fault.part != ENVIRONMENT:
        return fault.kind.nominal
    levels = space.levels(fault)
    rows = losses([space.canonical([*best.faults, replace(fault, severity=s)]) for s in levels])
    return levels[int(np.argmin(rows.sum(axis=1)))]
