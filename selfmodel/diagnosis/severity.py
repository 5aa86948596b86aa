"""How severe the faults of a hypothesis are: their degrees, fitted between a genome's levels."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.significance import NEGLIGIBLE, is_better, paired_z
from selfmodel.faults.hypothesis import Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

COARSE = 4
"""Levels of a part that a search looks at before it knows what is wrong; the degree comes later."""

POINTS, ZOOMS, ROUNDS = 7, 2, 2
"""Degrees that are tried around the best level, how often the search closes in on the best of them,
and how often it goes through all faults."""

DECIMALS = 4
"""What a degree is rounded to: nobody measures the ten-thousandth part of it."""


def coarse_candidates(kinds: Sequence[FaultKind], anatomy: Anatomy) -> list[Fault]:
    """Returns every kind of fault at every part, each at a few degrees.

    Args:
        kinds: What is considered.
        anatomy: The robot's parts.
    """
    return [
        Fault(kind, part, levels[i])
        for kind in kinds
        for part in kind.parts(anatomy)
        for levels in (kind.levels(anatomy, part),)
        for i in dict.fromkeys(np.linspace(0, len(levels) - 1, COARSE).round().astype(int).tolist())
    ]


def with_fitted_severities(hypothesis: Hypothesis, losses: Losses, anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis with those degrees by which it predicts best.

    Degrees are fitted one after another: the best of a kind's levels, then closer and closer.

    Args:
        hypothesis: In canonical form.
        losses: How badly hypotheses predict each piece of the trials, ``(n, pieces)``.
        anatomy: The robot's parts.
    """
    current = hypothesis
    for _ in range(ROUNDS):
        before = current
        for place in range(len(current)):
            if place < len(current):  # a degree may have turned out to mean that nothing is wrong
                current = _fitted(current, place, losses, anatomy)
        if current == before:
            break
    return current


def with_mean_severities(hypothesis: Hypothesis, losses: Losses, anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis with the means of the degrees that cannot be told from the best.

    Contact makes losses rugged over a degree, and where they are lowest is luck. A degree that
    predicts worse than the best by z standard errors, paired over the pieces, weighs exp(-z^2 / 2);
    one that lies beyond a degree that is ruled out, nothing.

    Args:
        hypothesis: With fitted degrees.
        losses: As for ``with_fitted_degrees``.
        anatomy: The robot's parts.
    """
    current = hypothesis
    for place in range(len(hypothesis)):
        mean = _averaged(current, place, losses, anatomy)
        if len(mean) == len(current) and not is_better(*losses([current, mean])):
            current = mean
    return current


def _averaged(hypothesis: Hypothesis, place: int, losses: Losses, anatomy: Anatomy) -> Hypothesis:
    fault = hypothesis.faults[place]
    limits = _limits(fault, anatomy)
    if limits is None or fault.kind.edit_spec:
        return hypothesis
    known = [fault.severity, *fault.kind.levels(anatomy, fault.part)]
    severities = sorted({*known, *_around(fault.severity, known, limits)})
    if len(severities) == 1:
        return hypothesis
    rows = losses([_with(hypothesis, place, severity, anatomy) for severity in severities])
    weights = _weights(rows)
    # They lie closer to each other around the best.
    mean = np.trapezoid(weights * severities, severities) / np.trapezoid(weights, severities)
    return _with(hypothesis, place, round(float(mean), DECIMALS), anatomy)


def _weights(rows: FloatArray) -> FloatArray:
    """How much neighbouring degrees count, ``(n,)``: beyond one that is ruled out, none does."""
    best = int(np.argmin(rows.sum(axis=1)))
    z = np.array([paired_z(row, rows[best]) if np.isfinite(row).all() else 0.0 for row in rows])
    worse = rows.mean(axis=1) > rows[best].mean() + NEGLIGIBLE
    out = np.array([is_better(rows[best], row) for row in rows]) | (worse & (z <= 0))
    low = max(np.flatnonzero(out[:best]), default=-1)
    high = best + min(np.flatnonzero(out[best:]), default=len(out))
    weights: FloatArray = np.exp(-np.square(z) / 2)
    weights[: low + 1] = weights[high:] = 0.0
    return weights


def _fitted(hypothesis: Hypothesis, place: int, losses: Losses, anatomy: Anatomy) -> Hypothesis:
    fault = hypothesis.faults[place]
    limits = _limits(fault, anatomy)
    if limits is None:
        return hypothesis
    severities = [fault.severity, *fault.kind.levels(anatomy, fault.part)]
    # What reshapes the model, such as rough terrain, has classes and no degrees in between.
    for _ in range(1 if fault.kind.edit_spec else 1 + ZOOMS):
        tried = [_with(hypothesis, place, severity, anatomy) for severity in severities]
        chosen = int(np.argmin(losses(tried).sum(axis=1)))
        severity, best = severities[chosen], tried[chosen]
        severities = [severity, *_around(severity, severities, limits)]
    return best


def _limits(fault: Fault, anatomy: Anatomy) -> tuple[float, float] | None:
    return fault.kind.severity_bounds(anatomy, fault.part) if fault.kind.severity_bounds else None


def _around(severity: float, known: Sequence[float], limits: tuple[float, float]) -> list[float]:
    """Degrees from the next smaller one that is known to the next larger one, or to a limit."""
    low = max((other for other in known if other < severity), default=limits[0])
    high = min((other for other in known if other > severity), default=limits[1])
    around: list[float] = np.linspace(low, high, POINTS).round(DECIMALS).tolist()
    return around


def _with(hypothesis: Hypothesis, place: int, severity: float, anatomy: Anatomy) -> Hypothesis:
    faults = list(hypothesis.faults)
    faults[place] = dataclasses.replace(faults[place], severity=severity)
    return canonical(faults, anatomy)
