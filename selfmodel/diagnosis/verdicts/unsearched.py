"""Unsearched faults: one more fault, of a kind outside the search, explains the trials better."""

import numpy as np

from selfmodel.diagnosis.diagnosis import UnsearchedFault
from selfmodel.diagnosis.loss_functions import SHORTLIST_SIZE, LossFunctions, by_total_loss
from selfmodel.diagnosis.verdicts.significance import (
    NEGLIGIBLE_LOSS,
    gain_exceeds_healthy_gain,
    is_better,
    paired_z,
)
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault
from selfmodel.faults.registry import ALL_KINDS


def best_unsearched_fault(
    best: Hypothesis, space: HypothesisSpace, losses: LossFunctions
) -> UnsearchedFault | None:
    """Returns the best hypothesis with one fault of an unsearched kind, if significantly better.

    One fault of a built-in kind is added to the best hypothesis, or replaces all faults of the same
    part. The gain has to be significant, and significantly larger than the gain of the fault alone
    on healthy trials; otherwise the fault corrects model error.

    Args:
        best: The best hypothesis of the searched kinds.
        space: The searched hypotheses.
        losses: Loss functions of the trials.

    Returns:
        The hypothesis with the lowest total loss that passes, with the best hypothesis of each
        other kind that passes; None if there is none, or if there are no comparable healthy trials.
    """
    if losses.healthy is None:
        return None
    best_losses = losses.damaged([best])[0]
    if not np.isfinite(best_losses).all() or best_losses.mean() <= NEGLIGIBLE_LOSS:
        return None
    candidates = _candidates(best, space)
    better: dict[str, Hypothesis] = {}
    for candidate in _shortlist(best, list(candidates), losses):
        kind = candidates[candidate].kind.name
        alone = space.canonical([candidates[candidate]])
        healthy_without, healthy_with = losses.healthy([INTACT, alone])
        damaged_with = losses.damaged([candidate])[0]
        # A reading that healthy trials predict better with the fault is predicted badly as such.
        changes_readings = not candidates[candidate].kind.affects_dynamics
        if changes_readings and is_better(healthy_with, healthy_without):
            continue
        if kind not in better and gain_exceeds_healthy_gain(
            damaged_with, best_losses, healthy_with, healthy_without
        ):
            better[kind] = candidate
    if not better:
        return None
    (first, hypothesis), *others = better.items()
    return UnsearchedFault(hypothesis, first, dict(others))


def unsearched_space(space: HypothesisSpace) -> HypothesisSpace:
    """Returns the hypotheses of the built-in kinds that are not searched.

    Kinds that edit the specification, such as rough terrain, are excluded: each hypothesis needs a
    compiled model.

    Args:
        space: The searched hypotheses.
    """
    kinds = [kind for kind in ALL_KINDS if kind not in space.kinds and not kind.edits_specification]
    return HypothesisSpace(space.anatomy, tuple(kinds), space.observed)


def _candidates(best: Hypothesis, space: HypothesisSpace) -> dict[Hypothesis, Fault]:
    """Candidate hypotheses, each with its unsearched fault."""
    found: dict[Hypothesis, Fault] = {}
    for fault in unsearched_space(space).coarse_candidates:
        others = [other for other in best.faults if other.part != fault.part]
        for faults in ((*best.faults, fault), (*others, fault)):
            found.setdefault(space.canonical(faults), fault)
    found.pop(best, None)
    return found


def _shortlist(
    best: Hypothesis, candidates: list[Hypothesis], losses: LossFunctions
) -> list[Hypothesis]:
    """The most significant gains by the surrogate, sorted by total loss of the comparator."""
    if not candidates:
        return []
    best_losses, *rows = losses.surrogate([best, *candidates])
    finite = np.isfinite(best_losses).all()
    z = [
        paired_z(best_losses, row) if finite and np.isfinite(row).all() else -np.inf for row in rows
    ]
    few = [candidates[i] for i in np.argsort(z, kind="stable")[::-1][:SHORTLIST_SIZE]]
    return by_total_loss(few, losses.damaged)
