"""Alternatives to the best hypothesis: what else the trials allow, and what they do not show.

All of them are functions of the trials, the best hypothesis and the hypotheses about the robot.
None depends on which hypotheses the search happened to compare.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.diagnosis import DetectableSeverity, UnsearchedFault
from selfmodel.diagnosis.joints import distinguished
from selfmodel.diagnosis.problem import LossFunction, Problem, by_total_loss
from selfmodel.diagnosis.search import SHORTLIST_SIZE, any_fault_is_model_error
from selfmodel.diagnosis.severity import with_fitted_severity
from selfmodel.diagnosis.significance import (
    LOSS_RATIO,
    MIN_Z_ACROSS_TRIALS,
    NEGLIGIBLE_LOSS,
    gain_exceeds_healthy_gain,
    is_better,
    paired_z,
)
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.registry import ALL_KINDS


def indistinguishable(best: Hypothesis, problem: Problem) -> list[Hypothesis]:
    """Returns the neighbours of the best hypothesis that predict the trials about as well.

    The neighbours have one fault less than the best, or another fault of the searched kinds in the
    place of one of its faults, or are single faults; they have at most as many faults. The eight
    best by the surrogate are compared, with the severity of the other fault fitted. A neighbour is
    indistinguishable unless it is significantly worse, by the loss or by that of a joint at which
    the two differ, or one of its faults corrects model error.

    Args:
        best: The best hypothesis.
        problem: The trials and their losses.

    Returns:
        Hypotheses sorted by total loss. Of those that differ in severities alone, the one with the
        smallest loss.
    """
    nearest = by_total_loss(_neighbours(best, problem.space), problem.coarse)
    few = list(best_severities(nearest))[:SHORTLIST_SIZE]
    fitted = [_with_fitted_others(one, best, problem) for one in few]
    candidates = by_total_loss(list(dict.fromkeys([*few, *fitted])), problem.losses)
    best_losses, *rows = problem.losses([best, *candidates])
    close = [
        one
        for one, row in zip(candidates, rows, strict=True)
        if without_severities(one) != without_severities(best)
        and not is_better(best_losses, row)
        and not any_fault_is_model_error(one, problem)
    ]
    if problem.has_joints:
        worse = distinguished(best, close, problem)
        close = [one for one, is_worse in zip(close, worse, strict=True) if not is_worse]
    return list(best_severities(close))


def _neighbours(best: Hypothesis, space: HypothesisSpace) -> list[Hypothesis]:
    parts = without_severities(best)
    listed = dict.fromkeys(
        [*space.with_one_less(best), *space.with_one_replaced(best), *space.with_one_more(INTACT)]
    )
    return [one for one in listed if len(one) <= len(best) and not parts <= without_severities(one)]


def _with_fitted_others(one: Hypothesis, best: Hypothesis, problem: Problem) -> Hypothesis:
    """Returns a neighbour with the severities fitted of the faults that the best lacks.

    A neighbour that is far from the best by the surrogate stays as it is: no fit makes up for it.
    """
    best_losses, losses = problem.coarse([best, one])
    if losses.mean() > LOSS_RATIO * best_losses.mean() + NEGLIGIBLE_LOSS:
        return one
    for fault in one.faults:
        if fault not in best.faults and fault in one.faults:
            index = one.faults.index(fault)
            one = with_fitted_severity(one, index, problem.coarse, problem.space)
    return one


def best_severities(hypotheses: Iterable[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Returns the first of the hypotheses that differ in severities alone, in the same order."""
    first: dict[frozenset[tuple[FaultKind, str]], Hypothesis] = {}
    for one in hypotheses:
        first.setdefault(without_severities(one), one)
    return tuple(first.values())


def without_severities(hypothesis: Hypothesis) -> frozenset[tuple[FaultKind, str]]:
    """Returns the kind and the part of each fault."""
    return frozenset((fault.kind.without_severity, fault.part) for fault in hypothesis.faults)


def undetectable(best: Hypothesis, problem: Problem) -> list[Hypothesis]:
    """Returns the best hypothesis with one fault more, for each fault that does not show.

    Added to the best hypothesis, an undetectable fault changes the loss significantly in neither
    direction. An example is a dead touch sensor in a foot that the gait never puts down. Kinds with
    severities are excluded: most have a severity that is too small to detect. Hypotheses that the
    surrogate comparator distinguishes from the best are not simulated further.

    Args:
        best: The best hypothesis; its simulation did not diverge.
        problem: The trials and their losses.

    Returns:
        Hypotheses sorted by total loss.
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
            and not is_better(best_losses, row)
            and not is_better(row, best_losses)
        ]
    return by_total_loss(candidates, problem.losses)


def unsearched_fault(best: Hypothesis, problem: Problem) -> UnsearchedFault | None:
    """Returns the best hypothesis with one fault of an unsearched kind, if significantly better.

    One fault of a built-in kind is added to the best hypothesis, or replaces all faults of the same
    part. The gain has to be significant, and significantly larger than the gain of the fault alone
    on healthy trials; otherwise the fault corrects model error.

    Args:
        best: The best hypothesis of the searched kinds.
        problem: The trials and their losses.

    Returns:
        The hypothesis with the lowest total loss that passes, with the best hypothesis of each
        other kind that passes; None if there is none, or if there are no comparable healthy trials.
    """
    (best_losses,) = problem.losses([best])
    is_exact = not np.isfinite(best_losses).all() or best_losses.mean() <= NEGLIGIBLE_LOSS
    if problem.healthy([INTACT]) is None or is_exact:
        return None
    candidates = _with_unsearched(best, problem.space)
    better: dict[str, Hypothesis] = {}
    for candidate in _largest_gains(best, list(candidates), problem):
        fault = candidates[candidate]
        healthy = problem.healthy([problem.space.canonical([fault]), INTACT])
        if healthy is None or fault.kind.name in better:
            continue
        # A reading that healthy trials predict better with the fault is predicted badly as such.
        if not fault.kind.affects_dynamics and is_better(*healthy):
            continue
        if gain_exceeds_healthy_gain(problem.losses([candidate])[0], best_losses, *healthy):
            better[fault.kind.name] = candidate
    if not better:
        return None
    (first, hypothesis), *others = better.items()
    return UnsearchedFault(hypothesis, first, dict(others))


def _with_unsearched(best: Hypothesis, space: HypothesisSpace) -> dict[Hypothesis, Fault]:
    """Returns hypotheses with a fault of an unsearched kind, each with that fault.

    Kinds that edit the specification, such as rough terrain, are excluded: each hypothesis needs a
    compiled model.
    """
    kinds = [kind for kind in ALL_KINDS if kind not in space.kinds and not kind.edits_specification]
    found: dict[Hypothesis, Fault] = {}
    for fault in HypothesisSpace(space.anatomy, tuple(kinds), space.observed).coarse_candidates:
        others = [other for other in best.faults if other.part != fault.part]
        for faults in ((*best.faults, fault), (*others, fault)):
            found.setdefault(space.canonical(faults), fault)
    found.pop(best, None)
    return found


def _largest_gains(
    best: Hypothesis, candidates: list[Hypothesis], problem: Problem
) -> list[Hypothesis]:
    """The most significant gains by the surrogate, sorted by total loss of the comparator."""
    best_losses, *rows = problem.coarse([best, *candidates])
    finite = np.isfinite(best_losses).all()
    z = [
        paired_z(best_losses, row) if finite and np.isfinite(row).all() else -np.inf for row in rows
    ]
    few = [candidates[i] for i in np.argsort(z, kind="stable")[::-1][:SHORTLIST_SIZE]]
    return by_total_loss(few, problem.losses)


@dataclass
class _Side:
    """Severities of a fault on one side of the nominal one, nearest first, and a bisection.

    All severities from index ``high`` on show; those before ``low`` do not.
    """

    fault: Fault
    severities: Sequence[float]
    low: int
    high: int

    @property
    def middle(self) -> Fault:
        return replace(self.fault, severity=self.severities[(self.low + self.high) // 2])

    @property
    def smallest(self) -> float | None:
        return self.severities[self.high] if self.high < len(self.severities) else None


def detectable_severities(
    best: Hypothesis, space: HypothesisSpace, losses: LossFunction
) -> list[DetectableSeverity]:
    """Returns the smallest detectable severities of every kind with a nominal severity.

    The nominal friction is the model's; the level with the smallest loss is taken for it. Parts
    with a fault in the best hypothesis are left out. A severity beyond one that shows is assumed to
    show too, so that a bisection over the kind's levels finds the limit.

    Args:
        best: The best hypothesis.
        space: The hypotheses about the robot.
        losses: Losses of hypotheses on the trials, ``(n, pieces)``.

    Returns:
        In the order of the kinds and their parts.
    """
    faulty = {fault.part for fault in best.faults}
    faults = [
        Fault(kind, part)
        for kind in space.kinds
        if kind.bounds is not None and not kind.edits_specification
        for part in kind.parts(space.anatomy)
        if part not in faulty
    ]
    nominal = {fault: _nominal(fault, best, space, losses) for fault in faults}
    sides = [
        side
        for fault, severity in nominal.items()
        if severity is not None
        for side in _sides(fault, severity, space)
    ]
    while open_ := [side for side in sides if side.low < side.high]:
        candidates = [space.canonical([*best.faults, side.middle]) for side in open_]
        best_losses, *rows = losses([best, *candidates])
        for side, row in zip(open_, rows, strict=True):
            middle = (side.low + side.high) // 2
            if _is_clearly_worse(row, best_losses):
                side.high = middle
            else:
                side.low = middle + 1
    return [
        DetectableSeverity(below.fault.kind.name, below.fault.part, below.smallest, above.smallest)
        for below, above in zip(sides[::2], sides[1::2], strict=True)
    ]


def _nominal(
    fault: Fault, best: Hypothesis, space: HypothesisSpace, losses: LossFunction
) -> float | None:
    """Returns the severity at which a fault has no effect; None if the kind has none."""
    known = [value for value, to in fault.kind.degenerates_to.items() if to is None]
    if known or fault.part != ENVIRONMENT:
        return known[0] if known else None
    levels = space.levels(fault)
    rows = losses([space.canonical([*best.faults, replace(fault, severity=s)]) for s in levels])
    return levels[int(np.argmin(rows.sum(axis=1)))]


def _sides(fault: Fault, nominal: float, space: HypothesisSpace) -> tuple[_Side, _Side]:
    """Returns the severities below and above the nominal one, nearest first."""
    levels = sorted(space.levels(fault))
    below = [level for level in reversed(levels) if level < nominal]
    above = [level for level in levels if level > nominal]
    halves = [[(nominal + side[0]) / 2, *side] if side else [] for side in (below, above)]
    first, second = (_Side(fault, side, 0, len(side)) for side in halves)
    return first, second


def _is_clearly_worse(one: FloatArray, best: FloatArray) -> bool:
    """Returns whether a fault would have been found: worse by more than a diagnosis requires.

    A fault is found if it is better than the empty hypothesis by ``significance.MIN_Z`` standard
    errors. The losses of a trial with the fault are not known, so the margin is larger. On the log
    of a real robot, weaknesses with ``MIN_Z`` were found in half of the cases.
    """
    if not np.isfinite(best).all():
        return False
    if not np.isfinite(one).all():
        return True
    more = one.mean() > best.mean() + NEGLIGIBLE_LOSS
    ratio = one.mean() > LOSS_RATIO * best.mean() + NEGLIGIBLE_LOSS
    return bool(more and (ratio or paired_z(one, best) >= MIN_Z_ACROSS_TRIALS))
