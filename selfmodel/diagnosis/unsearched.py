"""What was not considered: whether a kind outside the considered ones explains what is left."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.diagnosis import UnsearchedFault
from selfmodel.diagnosis.loss_functions import LossFunctions
from selfmodel.diagnosis.severity import coarse_candidates
from selfmodel.diagnosis.significance import NEGLIGIBLE, gain_exceeds_healthy_gain, paired_z
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.anatomy import Anatomy

SHORTLIST = 8
"""Hypotheses that are looked at closely, of those that the screen likes."""


def best_unsearched_fault(
    best: Hypothesis, considered: Sequence[FaultKind], anatomy: Anatomy, looks: LossFunctions
) -> UnsearchedFault | None:
    """Returns the best hypothesis with a fault that was not considered, if that explains more.

    One fault of one kind that comes with selfmodel is added to the best hypothesis, or takes the
    place of all that is said of the same part. The result has to predict the trials significantly
    better; and its fault alone must not do the same to trials of the intact robot, for then it
    mends the self-model and nothing has changed.

    Args:
        best: The best hypothesis of the considered kinds.
        considered: These kinds.
        anatomy: The robot's parts.
        looks: How badly hypotheses predict the trials.

    Returns:
        The one that predicts best; None where nothing outside explains more, or where there is
        nothing from before to compare with.
    """
    if looks.before is None:
        return None
    mine = looks.after([best])[0]
    if not np.isfinite(mine).all() or mine.mean() <= NEGLIGIBLE:
        return None
    candidates = _candidates(best, considered, anatomy)
    for candidate in _shortlist(best, candidates, looks):
        alone = canonical([candidates[candidate]], anatomy)
        usual, with_it = looks.before([INTACT, alone])
        if gain_exceeds_healthy_gain(looks.after([candidate])[0], mine, with_it, usual):
            return UnsearchedFault(candidate, candidates[candidate].kind.name)
    return None


def _candidates(
    best: Hypothesis, considered: Sequence[FaultKind], anatomy: Anatomy
) -> dict[Hypothesis, Fault]:
    """Hypotheses, and what each says that was not considered.

    What reshapes the model, such as rough terrain, is left out: each needs a model of its own.
    """
    outside = [kind for kind in ALL_KINDS if kind not in considered and kind.edit_spec is None]
    found: dict[Hypothesis, Fault] = {}
    for fault in coarse_candidates(outside, anatomy):
        others = [other for other in best.faults if other.part != fault.part]
        for faults in ((*best.faults, fault), (*others, fault)):
            found.setdefault(canonical(faults, anatomy), fault)
    found.pop(best, None)
    return found


def _shortlist(
    best: Hypothesis, candidates: dict[Hypothesis, Fault], looks: LossFunctions
) -> list[Hypothesis]:
    """Those that the screen likes most, the closest first."""
    if not candidates:
        return []
    asked = list(candidates)
    mine, *theirs = looks.screen([best, *asked])
    finite = np.isfinite(mine).all()
    z = [paired_z(mine, row) if finite and np.isfinite(row).all() else -np.inf for row in theirs]
    few = [asked[i] for i in np.argsort(z, kind="stable")[::-1][:SHORTLIST]]
    order = np.argsort(looks.after(few).sum(axis=1), kind="stable")
    return [few[i] for i in order]
