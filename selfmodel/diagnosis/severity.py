"""Severities of the faults of a hypothesis, fitted between the levels of the genome."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.problem import LossFunction
from selfmodel.diagnosis.significance import NEGLIGIBLE_LOSS, is_better, paired_z
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace

ZOOM_POINTS, ZOOMS, MAX_ROUNDS = 7, 2, 2
"""Severities per zoom, zooms per fault, and passes over all faults of a hypothesis."""

SEVERITY_DECIMALS = 4
"""Decimals of a fitted severity."""


def with_fitted_severities(
    hypothesis: Hypothesis, losses: LossFunction, space: HypothesisSpace, zooms: int = ZOOMS
) -> Hypothesis:
    """Returns the hypothesis with the severities of the lowest total loss.

    Severities are fitted by coordinate descent: per fault, the best of the kind's levels, then
    ``zooms`` grids, each between the neighbours of the best severity so far.

    Args:
        hypothesis: In canonical form.
        losses: LossFunction of hypotheses on the trials, ``(n, segments)``.
        space: The hypotheses about the robot.
        zooms: Number of grids between levels; 0 for the best levels.
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

    Args:
        hypothesis: In canonical form.
        index: Index of the fault in the hypothesis.
        losses: As for ``with_fitted_severities``.
        space: The hypotheses about the robot.
        zooms: As for ``with_fitted_severities``.
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
    """Returns the hypothesis with the mean of the severities indistinguishable from the best.

    Contact makes losses rugged over the severity, so the position of the minimum is random. With
    one seed and a true friction of 0.4, hardly any friction from 0.31 to 0.41 was a standard error
    worse than another, 0.31 had the lowest loss, and the mean is 0.36. A severity whose loss is z
    standard errors above the best, paired over the segments, has the weight exp(-z^2 / 2).
    Severities beyond a ruled-out severity have no weight.

    Args:
        hypothesis: With fitted severities.
        losses: As for ``with_fitted_severities``.
        space: The hypotheses about the robot.
    """
    current = hypothesis
    for index in range(len(hypothesis)):
        mean = _averaged(current, index, losses, space)
        if len(mean) == len(current) and not is_better(*losses([current, mean])):
            current = mean
    return current


def _averaged(
    hypothesis: Hypothesis, index: int, losses: LossFunction, space: HypothesisSpace
) -> Hypothesis:
    fault = hypothesis.faults[index]
    bounds = space.severity_bounds(fault)
    if bounds is None or fault.kind.edits_specification:
        return hypothesis
    known = [fault.severity, *space.levels(fault)]
    severities = sorted({*known, *_around(fault.severity, known, bounds)})
    if len(severities) == 1:
        return hypothesis
    rows = losses([space.with_severity(hypothesis, index, severity) for severity in severities])
    weights = _weights(rows)
    # Integrals, because severities are denser around the best.
    mean = np.trapezoid(weights * severities, severities) / np.trapezoid(weights, severities)
    return space.with_severity(hypothesis, index, round(float(mean), SEVERITY_DECIMALS))


def _weights(rows: FloatArray) -> FloatArray:
    """Weights of ascending severities, ``(n,)``; 0 from the first ruled-out one on either side."""
    best = int(np.argmin(rows.sum(axis=1)))
    z = np.array([paired_z(row, rows[best]) if np.isfinite(row).all() else 0.0 for row in rows])
    worse = rows.mean(axis=1) > rows[best].mean() + NEGLIGIBLE_LOSS
    out = np.array([is_better(rows[best], row) for row in rows]) | (worse & (z <= 0))
    low = max(np.flatnonzero(out[:best]), default=-1)
    high = best + min(np.flatnonzero(out[best:]), default=len(out))
    weights: FloatArray = np.exp(-np.square(z) / 2)
    weights[: low + 1] = weights[high:] = 0.0
    return weights


def _around(severity: float, known: Sequence[float], bounds: tuple[float, float]) -> list[float]:
    """A grid from the next smaller known severity to the next larger one, or to the bounds."""
    low = max((other for other in known if other < severity), default=bounds[0])
    high = min((other for other in known if other > severity), default=bounds[1])
    around: list[float] = np.linspace(low, high, ZOOM_POINTS).round(SEVERITY_DECIMALS).tolist()
    return around
