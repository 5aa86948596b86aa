"""How severe the faults of a hypothesis are: their degrees, fitted between a genome's levels."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.arrays import FloatArray
from selfmodel.faults import Fault, Kind
from selfmodel.hypothesis import Hypothesis, canonical

COARSE = 4
"""Levels of a part that a search looks at before it knows what is wrong; the degree comes later."""

POINTS, ZOOMS, ROUNDS = 7, 2, 2
"""Degrees that are tried around the best level, how often the search closes in on the best of them,
and how often it goes through all faults."""

DECIMALS = 4
"""What a degree is rounded to: nobody measures the ten-thousandth part of it."""


def coarse_candidates(kinds: Sequence[Kind], anatomy: Anatomy) -> list[Fault]:
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


def with_fitted_degrees(
    hypothesis: Hypothesis,
    losses: Callable[[Sequence[Hypothesis]], FloatArray],
    anatomy: Anatomy,
) -> Hypothesis:
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


def _fitted(
    hypothesis: Hypothesis,
    place: int,
    losses: Callable[[Sequence[Hypothesis]], FloatArray],
    anatomy: Anatomy,
) -> Hypothesis:
    fault = hypothesis.faults[place]
    if fault.kind.degrees is None:
        return hypothesis
    low, high = fault.kind.degrees(anatomy, fault.part)
    degrees = [fault.degree, *fault.kind.levels(anatomy, fault.part)]
    # What reshapes the model, such as rough terrain, has classes and no degrees in between.
    for _ in range(1 if fault.kind.reshape else 1 + ZOOMS):
        tried = [_with(hypothesis, place, degree, anatomy) for degree in degrees]
        chosen = int(np.argmin(losses(tried).sum(axis=1)))
        degree, best = degrees[chosen], tried[chosen]
        below = [other for other in degrees if other < degree]
        above = [other for other in degrees if other > degree]
        around = np.linspace(max(below, default=low), min(above, default=high), POINTS)
        degrees = [degree, *around.round(DECIMALS).tolist()]
    return best


def _with(hypothesis: Hypothesis, place: int, degree: float, anatomy: Anatomy) -> Hypothesis:
    faults = list(hypothesis.faults)
    faults[place] = dataclasses.replace(faults[place], degree=degree)
    return canonical(faults, anatomy)
