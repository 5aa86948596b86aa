"""Whether one hypothesis predicts the trials significantly better than another.

Two hypotheses are compared over the same pieces of the trials, so what makes a piece hard to
predict for both does not count. A piece is not independent of the next one, and a model that is not
the robot errs everywhere in the same way: so much more is asked for than a textbook would.
"""

import numpy as np

from selfmodel.arrays import FloatArray

Z = 3.0
"""How many standard errors the mean difference of two hypotheses must have. Of some 1,500 faults
that were proposed beside the truth, across gaps of 0.1 and 0.2, none reached 2."""

WORSE = 5.0
"""How many standard errors a mean loss must be above the usual one: other trials, other gaits, and
so more than for two hypotheses on the same pieces."""

RATIO = 3.0
"""How many times as large a mean loss counts as larger whatever the errors: where prediction is all
but perfect, a few pieces that tell are proof."""

NEGLIGIBLE = 1e-6
"""A mean loss below this is none: what is left where the model is the robot is the rounding of its
arithmetic."""

TEST = f"paired z over the pieces of the trials >= {Z:g}, or {RATIO:g} times the loss"
"""The test in words."""


def is_better(one: FloatArray, other: FloatArray) -> bool:
    """Returns whether the first of two hypotheses predicts significantly better.

    Args:
        one: Its losses, ``(pieces,)``.
        other: The losses of the other on the same pieces, ``(pieces,)``. Either is infinite where
            a simulation diverged; then it is not the better one.
    """
    if not np.isfinite(one).all():
        return False
    if not np.isfinite(other).all():
        return True
    if not other.mean() > one.mean() + NEGLIGIBLE:
        return False
    return bool(paired_z(other, one) >= Z or other.mean() > RATIO * one.mean() + NEGLIGIBLE)


def paired_z(larger: FloatArray, smaller: FloatArray) -> float:
    """Returns the mean difference of finite losses over its standard error.

    It is 0 for less than two pieces, and where all pieces differ by the same.
    """
    difference = larger - smaller
    error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return float(difference.mean() / error) if error > 0 else 0.0


def gain_exceeds_healthy_gain(
    one: FloatArray, other: FloatArray, one_before: FloatArray, other_before: FloatArray
) -> bool:
    """Returns whether a hypothesis predicts significantly better since something is wrong.

    What helps as much where nothing was wrong only mends the model. It is asked of hundreds of
    hypotheses, so ``WORSE`` standard errors are wanted.

    Args:
        one: The losses of the hypothesis, ``(pieces,)``.
        other: Those of the hypothesis to beat, on the same pieces.
        one_before: As ``one``, of other trials, from before.
        other_before: As ``other``, of these.
    """
    gains = _gains(one, other, one_before, other_before)
    if gains is None or not gains[0].mean() > NEGLIGIBLE:
        return False
    more, error = _unpaired(*gains)
    return paired_z(other, one) >= WORSE and more >= WORSE * error


def gain_is_model_error(
    one: FloatArray, other: FloatArray, one_before: FloatArray, other_before: FloatArray
) -> bool:
    """Returns whether what predicts better mends the model, and tells of no change.

    It would have helped before anything was wrong, and does not help significantly more since;
    though what is really wrong would have done as much harm then as it helps now, and that much the
    trials would have shown.

    Args:
        one: The losses of the better hypothesis; this and the others as for ``has_become_better``.
        other: Those of the other.
        one_before: As ``one``, from before.
        other_before: As ``other``, from before.
    """
    gains = _gains(one, other, one_before, other_before)
    if gains is None or not gains[1].mean() > NEGLIGIBLE:
        return False
    more, error = _unpaired(*gains)
    return more < Z * error < 2 * float(gains[0].mean())


def _gains(
    one: FloatArray, other: FloatArray, one_before: FloatArray, other_before: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """By how much the first predicts each piece better, and did before; None where nobody knows."""
    known = all(np.isfinite(losses).all() for losses in (one, other, one_before, other_before))
    if not known or min(len(one), len(one_before)) < 2:
        return None
    return other - one, other_before - one_before


def exceeds_healthy_loss(losses: FloatArray, usual: FloatArray) -> bool:
    """Returns whether losses are significantly higher than those of a model that was right.

    Args:
        losses: ``(pieces,)``.
        usual: ``(pieces,)`` of other trials, so the two are not paired (Welch). Where either has
            one piece only, or diverged, nothing but the ratio can tell.
    """
    larger = bool(losses.mean() > RATIO * usual.mean() + NEGLIGIBLE)
    if min(len(losses), len(usual)) < 2 or not np.isfinite([losses.mean(), usual.mean()]).all():
        return larger
    difference, error = _unpaired(losses, usual)
    return larger or difference > WORSE * error + NEGLIGIBLE


def _unpaired(one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """By how much the first mean is larger, and the standard error of that (Welch)."""
    variance = one.var(ddof=1) / len(one) + other.var(ddof=1) / len(other)
    return float(one.mean() - other.mean()), float(np.sqrt(variance))
