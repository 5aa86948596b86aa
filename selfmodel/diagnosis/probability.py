"""Probabilities of hypotheses, from the statistics that decide the verdict.

A hypothesis over which the best one leads by ``z`` standard errors (``verdict.leads_of``) has the
weight ``exp(-(z / TEMPERATURE)^2 / 2)`` of the best; the lead of an indistinguishable one is less
than ``MIN_Z``. Beside the hypotheses there is a fault of another kind, whose odds against them grow
with the loss that is left (``unlikeness``). The part ``UNKNOWN`` is kept for what no statistic of
the trials shows.

The probability is that of the kinds and parts of all faults, at about the named severities, given
that no fault is too small to show and that the healthy trials were healthy.
"""

from collections.abc import Mapping
from math import exp

from selfmodel.diagnosis import significance
from selfmodel.diagnosis.diagnosis import Fit
from selfmodel.faults.hypothesis import Hypothesis

TEMPERATURE = 1.5

STEEPNESS = 6.0

UNKNOWN = 0.05


def probabilities(
    best: Hypothesis, leads: Mapping[Hypothesis, float], fit: Fit, *, misses: bool
) -> dict[str, float]:
    """Returns the probabilities of the best hypothesis and its neighbours, by their notation.

    Args:
        best: The best hypothesis.
        leads: Its lead over each neighbour, standard errors. Of neighbours that differ in
            severities alone, there is the one with the smallest lead.
        fit: How well the best hypothesis predicts the trials.
        misses: Whether a fault of an unsearched kind predicts the trials better.

    Returns:
        Numbers whose sum is at most ``1 - UNKNOWN``. The rest is the probability that none of them
        is right: of a fault of another kind, or of a further one.
    """
    weights = {best: 1.0} | {one: exp(-((z / TEMPERATURE) ** 2) / 2) for one, z in leads.items()}
    odds = unlikeness(fit) ** STEEPNESS
    share = 0.0 if misses else (1 - UNKNOWN) / (1 + odds)
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
