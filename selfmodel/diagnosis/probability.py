"""Probabilities of hypotheses, from the statistics that decide the verdict.

A hypothesis over which the best one leads by ``z`` standard errors (``leads_of``) has the weight
``exp(-z^2 / 2)``, the best has 1. Those with ``z`` below ``MIN_Z``, 1.1 % of the best's weight,
cannot be told apart. Beside all of them there is a fault that was not searched, whose odds grow
with the loss that is left (``unlikeness``).

The probability is that of the kinds and parts of all faults, at about the named severities, if no
fault is too small to show. The constants are of recordings of our own generator; docs/results has
the reliability on those of another one.
"""

from collections.abc import Mapping
from math import exp

from selfmodel.diagnosis import significance
from selfmodel.diagnosis.diagnosis import Fit
from selfmodel.faults.hypothesis import Hypothesis

UNKNOWN = 0.04
"""Least probability that a clear diagnosis is wrong. Of 541 diagnoses of one trial that were
``explained``, with gaps of 0.05 to 0.2, 23 were wrong; of 593 of three trials, 7."""

STEEPNESS = 4.0
"""Power of ``unlikeness`` in the odds of a fault that was not searched, which are even at the limit
of the verdict. In 52 diagnoses of known faults and missing ones, the most probable power is 2.5,
with a limit of 1.6 it is 4.5: in 38 of them, of trials of 4 s, right hypotheses had up to 1.84."""


def probabilities(
    best: Hypothesis, leads: Mapping[Hypothesis, float], fit: Fit, *, misses: bool
) -> dict[str, float]:
    """Returns the probabilities of the best hypothesis and its neighbours, by their notation.

    Args:
        best: The best hypothesis.
        leads: Its lead over each neighbour, standard errors. Of neighbours that differ in
            severities alone, there is the one with the smallest lead.
        fit: How well the best hypothesis predicts the trials.
        misses: Whether a fault of an unsearched kind predicts the trials better, or a joint moves
            otherwise.

    Returns:
        Numbers of which the rest up to 1 is the probability of a fault that was not searched, of a
        further one, or of an error.
    """
    weights = {best: 1.0} | {one: exp(-(lead**2) / 2) for one, lead in leads.items()}
    odds = unlikeness(fit) ** STEEPNESS
    share = UNKNOWN + (0.0 if misses else (1 - 2 * UNKNOWN) / (1 + odds))
    total = sum(weights.values())
    return {str(one): share * weight / total for one, weight in weights.items()}


def unlikeness(fit: Fit) -> float:
    """Returns the loss of the best hypothesis over the largest that is expected of the right one.

    From 1 on, the best hypothesis does not explain the trials: its loss is higher than that of
    healthy trials, significantly and by much, or that of a joint is. Faults make a motion harder to
    predict: a slipping foot, a body on the ground. So the loss of a hypothesis with faults has to
    exceed the reference by the factor ``FAULTY_RATIO`` too. 0 without healthy trials.
    """
    if fit.healthy_loss is None or fit.excess is None:
        return 0.0
    ratio, many = (
        fit.loss / (times * fit.healthy_loss + significance.LOSS_FLOOR)
        for times in (significance.FAULTY_RATIO, significance.LOSS_RATIO)
    )
    excess = fit.excess / fit.threshold
    return max(many, min(excess, ratio) if fit.has_faults else excess)
