"""Undetectable faults: added to the best hypothesis, they change the loss insignificantly."""

from collections.abc import Sequence

import numpy as np

from selfmodel.diagnosis.loss_functions import Losses, LossFunctions, by_total_loss
from selfmodel.diagnosis.verdicts.significance import is_better
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace


def undetectable_faults(
    best: Hypothesis, space: HypothesisSpace, losses: LossFunctions
) -> list[Hypothesis]:
    """Returns the best hypothesis with one fault more, for each undetectable fault.

    An example is a dead touch sensor in a foot that the gait never puts down. Kinds with severities
    are excluded: most have a severity that is too small to detect.

    Args:
        best: The best hypothesis.
        space: The hypotheses about the robot; faults of its kinds are added.
        losses: Loss functions of the trials. Hypotheses that the surrogate comparator
            distinguishes from the best are not simulated further.

    Returns:
        Hypotheses sorted by total loss; none if the simulation of the best hypothesis diverged.
    """
    faults = [fault for fault in space.coarse_candidates if fault.kind.bounds is None]
    distinct = dict.fromkeys(space.canonical([*best.faults, fault]) for fault in faults)
    larger = [one for one in distinct if len(one) > len(best)]
    candidates = _indistinguishable(best, larger, losses.surrogate)
    return by_total_loss(_indistinguishable(best, candidates, losses.damaged), losses.damaged)


def _indistinguishable(
    best: Hypothesis, others: Sequence[Hypothesis], losses: Losses
) -> list[Hypothesis]:
    best_losses, *rows = losses([best, *others])
    if not np.isfinite(best_losses).all():
        return []
    return [
        other
        for other, row in zip(others, rows, strict=True)
        if not is_better(best_losses, row) and not is_better(row, best_losses)
    ]
