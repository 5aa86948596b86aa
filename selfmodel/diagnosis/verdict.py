"""The verdict of a diagnosis: ``explained``, ``ambiguous`` or ``unexplained``."""

import math
from collections.abc import Callable, Sequence

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.diagnosis.significance import exceeds_healthy_loss
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.trials.trial import Trial

NO_TEST = "none: every simulation diverged"
"""Name of the test of a diagnosis without a finite distance."""


def verdict_of(
    *,
    losses: Callable[[], FloatArray],
    healthy: Callable[[], FloatArray] | None,
    indistinguishable: Sequence[Hypothesis],
    unsearched: UnsearchedFault | None,
) -> Verdict:
    """Returns the verdict about the best hypothesis of a diagnosis.

    The verdict is ``unexplained`` if an unsearched fault predicts the trials significantly better,
    or if the loss is significantly higher than that of the self-model on healthy trials; otherwise
    ``ambiguous`` if other hypotheses are indistinguishable from the best, else ``explained``.

    Args:
        losses: Computes the losses of the best hypothesis on the trials to explain,
            ``(1, segments)``.
        healthy: Computes the losses of the empty hypothesis on healthy trials, ``(1, segments)``;
            None without healthy trials. Called only where the verdict depends on it.
        indistinguishable: Hypotheses not significantly worse than the best.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it is better.
    """
    if unsearched is not None:
        return "unexplained"
    if healthy is not None and exceeds_healthy_loss(losses()[0], healthy()[0]):
        return "unexplained"
    return "ambiguous" if indistinguishable else "explained"


def all_diverged(ranked: Sequence[Hypothesis], trials: Sequence[Trial]) -> Diagnosis:
    """Returns the diagnosis of trials on which the simulation of every hypothesis diverged.

    The verdict is ``unexplained``: the trials do not support any of the hypotheses.

    Args:
        ranked: Hypotheses that were compared with the trials, at least one.
        trials: The trials to explain.
    """
    logs = ", ".join(trial.path for trial in trials)
    return Diagnosis(
        ranked=tuple(Candidate(hypothesis, math.inf) for hypothesis in ranked),
        trials=len(trials),
        intact_distance=math.inf,
        indistinguishable=(),
        verdict="unexplained",
        test=NO_TEST,
        reason=(
            f"no simulation of the trials remained finite: check the model, and the units and the "
            f"odometry of {logs}"
        ),
    )
