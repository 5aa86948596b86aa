"""Change-point: the time at which the robot changed, from losses along time.

The pieces of all trials, in the order of the trials, are one timeline. Before a change, one
hypothesis predicts the pieces; after it, another. The losses of the candidates are known from the
search, so a scan over all times is a cumulative sum and needs no further simulation.

Source: Page, "Continuous inspection schemes", Biometrika 41 (1954), the cumulative sum; here of the
differences of two hypotheses' losses, over all times afterwards.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.diagnosis.diagnosis import Change
from selfmodel.diagnosis.losses import Timeline
from selfmodel.diagnosis.problem import LossFunction
from selfmodel.diagnosis.significance import (
    CHANGE_TOLERANCE,
    MIN_PIECES,
    MIN_Z_OF_CHANGE,
    is_better,
    paired_z,
)
from selfmodel.faults.hypothesis import Hypothesis

SHORTLIST = 8
"""Candidates whose change is computed with the comparator itself."""


@dataclass(frozen=True)
class Split:
    """A change between two pieces of a timeline.

    Attributes:
        before: Hypothesis about the pieces before the change.
        after: Hypothesis about the pieces from the change on.
        piece: Index of the first piece after the change.
    """

    before: Hypothesis
    after: Hypothesis
    piece: int


def best_split(
    before: Sequence[Hypothesis],
    after: Sequence[Hypothesis],
    coarse: LossFunction,
    losses: LossFunction,
) -> Split | None:
    """Returns the change between two hypotheses with the smallest total loss.

    Args:
        before: Hypotheses about the time before the change.
        after: Hypotheses about the time after it.
        coarse: Losses of the surrogate comparator, ``(n, pieces)``, which select the hypotheses.
        losses: Losses of the comparator itself, which decide.

    Returns:
        None if the timeline is too short, or if every simulation diverged.
    """
    pieces, few = (each(before[:1]).shape[1] for each in (losses, coarse))
    least = max(2, round(MIN_PIECES * few / pieces))
    ranked = dict.fromkeys(split.after for split in _splits(before, after, coarse, least))
    found = _splits(before, list(ranked)[:SHORTLIST], losses, MIN_PIECES)
    return found[0] if found else None


def is_change(split: Split, single: Hypothesis, losses: LossFunction) -> bool:
    """Returns whether a change predicts the trials significantly better than no change.

    Three conditions hold: before the change, the first hypothesis is significantly better than the
    second; after it, the second is better than the first by ``MIN_Z_OF_CHANGE`` standard errors;
    and with the change, all pieces together are predicted significantly better than without.

    Args:
        split: The change.
        single: The best hypothesis without a change.
        losses: Losses on the timeline, ``(n, pieces)``.
    """
    before, after, alone = losses([split.before, split.after, single])
    k = split.piece
    changed = np.concatenate([before[:k], after[k:]])
    return (
        is_better(before[:k], after[:k])
        and is_better(after[k:], before[k:])
        and paired_z(before[k:], after[k:]) >= MIN_Z_OF_CHANGE
        and is_better(changed, alone)
    )


def change_at(
    split: Split, losses: LossFunction, timeline: Timeline, names: Sequence[str]
) -> Change:
    """Returns the change of a split, with its time and the bounds of the time.

    The bounds are those of the pieces between which the change costs at most ``CHANGE_TOLERANCE``
    mean differences of a piece more than at the best place.

    Args:
        split: The change.
        losses: Losses on the timeline, ``(n, pieces)``.
        timeline: Times of the pieces.
        names: Names of the trials.
    """
    before, after = losses([split.before, split.after])
    k = split.piece
    totals = _totals(before, after)
    typical = min((after - before)[:k].mean(), (before - after)[k:].mean())
    possible = _run_around(totals <= totals[k] + CHANGE_TOLERANCE * max(float(typical), 0.0), k)
    index = int(timeline.trial[k])
    inside = np.flatnonzero(timeline.trial == index)
    first, last = np.clip(possible, inside[0], inside[-1]).tolist()
    return Change(
        trial=names[index],
        index=index,
        time=float(timeline.begin[k]),
        earliest=float(timeline.begin[max(first - 1, inside[0])]),
        latest=float(timeline.end[last]),
        before=split.before,
        after=split.after,
    )


def _splits(
    before: Sequence[Hypothesis], after: Sequence[Hypothesis], losses: LossFunction, least: int
) -> list[Split]:
    """Returns the best change from any hypothesis before to each one after, best first.

    Args:
        before: Hypotheses about the time before the change.
        after: Hypotheses about the time after it.
        losses: Losses on the timeline, ``(n, pieces)``.
        least: Pieces before and after the change, at least.
    """
    if not after:
        return []
    rows = losses([*before, *after])
    firsts, seconds = rows[: len(before)], rows[len(before) :]
    if rows.shape[1] < 2 * least:
        return []
    found: list[tuple[float, int, Split]] = []
    for second, row in zip(after, seconds, strict=True):
        for first, own in zip(before, firsts, strict=True):
            if first == second or not (np.isfinite(own).all() and np.isfinite(row).all()):
                continue
            totals = _totals(own, row)
            inner = totals[least : len(row) - least + 1]
            piece = least + int(np.argmin(inner))
            found.append((float(totals[piece]), len(found), Split(first, second, piece)))
    return [split for _, _, split in sorted(found, key=lambda one: one[:2])]


def _totals(before: FloatArray, after: FloatArray) -> FloatArray:
    """Returns the total loss of a change before each piece, ``(pieces + 1,)``."""
    past = np.append(0.0, np.cumsum(before))
    rest = np.append(np.cumsum(after[::-1])[::-1], 0.0)
    return np.asarray(past + rest)


def _run_around(mask: BoolArray, k: int) -> tuple[int, int]:
    """Returns the first and the last index of the run of true values around index k."""
    no = np.flatnonzero(~mask)
    first = int(no[no < k].max(initial=-1)) + 1
    last = int(no[no > k].min(initial=len(mask))) - 1
    return max(first, 1), min(last, len(mask) - 2)
