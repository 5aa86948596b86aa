"""The verdict of a diagnosis: ``intact``, ``explained``, ``ambiguous`` or ``unexplained``."""

import math
from collections.abc import Mapping, Sequence

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.diagnosis.verdicts.significance import (
    MIN_Z_OF_ONE_GAIT,
    MIN_Z_OF_OTHER_GAITS,
    excess_over_healthy,
)
from selfmodel.faults.hypothesis import Hypothesis

NO_TEST = "none: every simulation diverged"
"""Name of the test of a diagnosis without a finite distance."""


def fit_of(
    best: Hypothesis,
    losses: FloatArray,
    intact: FloatArray,
    healthy: FloatArray | None,
    *,
    is_one_gait: bool,
    joints: Mapping[str, float],
) -> Fit:
    """Returns how well the best hypothesis predicts the trials.

    Args:
        best: The best hypothesis.
        losses: Losses of the best hypothesis on the trials to explain, ``(pieces,)``.
        intact: Losses of the empty hypothesis on the same trials.
        healthy: Losses of the empty hypothesis on healthy trials, ``(healthy_pieces,)``; None
            without healthy trials.
        is_one_gait: Whether the healthy trials have the gaits of the trials to explain.
        joints: Excess of the losses of suspected joints; see ``Fit.joints``.
    """
    return Fit(
        loss=float(losses.mean()),
        intact_loss=float(intact.mean()),
        healthy_loss=None if healthy is None else float(healthy.mean()),
        excess=None if healthy is None else excess_over_healthy(losses, healthy),
        threshold=MIN_Z_OF_ONE_GAIT if is_one_gait else MIN_Z_OF_OTHER_GAITS,
        has_faults=bool(best),
        joints=joints,
    )


def verdict_of(
    best: Hypothesis,
    fit: Fit,
    indistinguishable: Sequence[Hypothesis],
    unsearched: UnsearchedFault | None,
) -> Verdict:
    """Returns the verdict about the best hypothesis of a diagnosis.

    The verdict is ``unexplained`` if an unsearched fault predicts the trials significantly better,
    or if the loss is significantly higher than that of the self-model on healthy trials; otherwise
    ``ambiguous`` if other hypotheses are indistinguishable from the best, else ``explained``, or
    ``intact`` for the empty hypothesis.

    Args:
        best: The best hypothesis.
        fit: Its loss, compared with that of healthy trials.
        indistinguishable: Hypotheses not significantly worse than the best.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it is better.
    """
    if unsearched is not None or fit.is_unexplained:
        return "unexplained"
    if indistinguishable:
        return "ambiguous"
    return "explained" if best else "intact"


def all_diverged(ranked: Sequence[Hypothesis], paths: Sequence[str]) -> Diagnosis:
    """Returns the diagnosis of trials on which the simulation of every hypothesis diverged.

    The verdict is ``unexplained``: the trials do not support any of the hypotheses.

    Args:
        ranked: Hypotheses that were compared with the trials, at least one.
        paths: Paths of the logs of the trials to explain.
    """
    logs = ", ".join(paths)
    return Diagnosis(
        ranked=tuple(Candidate(hypothesis, math.inf) for hypothesis in ranked),
        trials=len(paths),
        intact_distance=math.inf,
        indistinguishable=(),
        verdict="unexplained",
        test=NO_TEST,
        reason=(
            f"no simulation of the trials remained finite: check the model, and the units and the "
            f"odometry of {logs}"
        ),
    )
