"""Smallest detectable severity of each fault kind and part: the limit of what the trials show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis.loss_functions import Losses
from selfmodel.diagnosis.verdicts.significance import (
    LOSS_RATIO,
    MIN_Z_ACROSS_TRIALS,
    NEGLIGIBLE_LOSS,
    paired_z,
)
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault


@dataclass(frozen=True)
class DetectableSeverity:
    """The smallest severities of a fault that the trials would have shown, on either side.

    Attributes:
        kind: Name of the fault kind.
        part: Name of the part; empty for an environment.
        below: The largest severity below the nominal one that predicts the trials clearly worse
            than the best hypothesis; None if no such severity would have shown.
        above: The smallest severity above the nominal one, likewise.
    """

    kind: str
    part: str
    below: float | None
    above: float | None

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values."""
        return {"kind": self.kind, "part": self.part, "below": self.below, "above": self.above}


@dataclass
class _Side:
    """Severities of a fault on one side of the nominal one, nearest first, and a bisection.

    All severities from index ``high`` on show; those before ``low`` do not.
    """

    fault: Fault
    severities: Sequence[float]
    low: int
    high: int

    @property
    def middle(self) -> int:
        return (self.low + self.high) // 2

    @property
    def smallest(self) -> float | None:
        return self.severities[self.high] if self.high < len(self.severities) else None


def detectable_severities(
    best: Hypothesis, space: HypothesisSpace, losses: Losses
) -> list[DetectableSeverity]:
    """Returns the smallest detectable severities of every kind with a nominal severity.

    The nominal friction is the model's; the level with the smallest loss is taken for it. Parts
    with a fault in the best hypothesis are left out. A severity beyond one that shows is assumed to
    show too, so that a bisection over the kind's levels finds the limit.

    Args:
        best: The best hypothesis.
        space: The hypotheses about the robot.
        losses: Losses of hypotheses on the trials, ``(n, segments)``.

    Returns:
        In the order of the kinds and their parts.
    """
    faulty = {fault.part for fault in best.faults}
    faults = [
        Fault(kind, part)
        for kind in space.kinds
        if kind.bounds is not None and not kind.edits_specification
        for part in kind.parts(space.anatomy)
        if part not in faulty
    ]
    nominal = {fault: _nominal(fault, best, space, losses) for fault in faults}
    sides = [
        side
        for fault, severity in nominal.items()
        if severity is not None
        for side in _sides(fault, severity, space)
    ]
    while open_ := [side for side in sides if side.low < side.high]:
        candidates = [_with(best, side, space) for side in open_]
        best_losses, *rows = losses([best, *candidates])
        for side, row in zip(open_, rows, strict=True):
            if _is_clearly_worse(row, best_losses):
                side.high = side.middle
            else:
                side.low = side.middle + 1
    return [
        DetectableSeverity(below.fault.kind.name, below.fault.part, below.smallest, above.smallest)
        for below, above in zip(sides[::2], sides[1::2], strict=True)
    ]


def _nominal(
    fault: Fault, best: Hypothesis, space: HypothesisSpace, losses: Losses
) -> float | None:
    """Returns the severity at which a fault has no effect; None if the kind has none."""
    known = [value for value, to in fault.kind.degenerates_to.items() if to is None]
    if known or fault.part != ENVIRONMENT:
        return known[0] if known else None
    levels = space.levels(fault)
    rows = losses([space.canonical([*best.faults, replace(fault, severity=s)]) for s in levels])
    return levels[int(np.argmin(rows.sum(axis=1)))]


def _sides(fault: Fault, nominal: float, space: HypothesisSpace) -> tuple[_Side, _Side]:
    """Returns the severities below and above the nominal one, nearest first."""
    levels = sorted(space.levels(fault))
    below = [level for level in reversed(levels) if level < nominal]
    above = [level for level in levels if level > nominal]
    halves = [[(nominal + side[0]) / 2, *side] if side else [] for side in (below, above)]
    first, second = (_Side(fault, side, 0, len(side)) for side in halves)
    return first, second


def _with(best: Hypothesis, side: _Side, space: HypothesisSpace) -> Hypothesis:
    fault = side.fault
    return space.canonical([*best.faults, replace(fault, severity=side.severities[side.middle])])


def _is_clearly_worse(one: FloatArray, best: FloatArray) -> bool:
    """Returns whether a fault would have been found: worse by more than a diagnosis requires.

    A fault is found if it is better than the empty hypothesis by ``significance.MIN_Z`` standard
    errors. The losses of a trial with the fault are not known, so the margin is larger. On the log
    of a real robot, weaknesses with ``MIN_Z`` were found in half of the cases.
    """
    if not np.isfinite(best).all():
        return False
    if not np.isfinite(one).all():
        return True
    more = one.mean() > best.mean() + NEGLIGIBLE_LOSS
    ratio = one.mean() > LOSS_RATIO * best.mean() + NEGLIGIBLE_LOSS
    return bool(more and (ratio or paired_z(one, best) >= MIN_Z_ACROSS_TRIALS))
