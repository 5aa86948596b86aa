"""Significance tests on losses, and every threshold of a diagnosis with its evidence.

Two hypotheses are compared over the same segments (windows, for closed-loop comparators), so the
difficulty of a segment cancels. Losses of different trials are compared unpaired. Neighbouring
segments are dependent and the errors of a wrong model are systematic, so the significance levels
are stricter than a textbook's.
"""

import math

import numpy as np

from selfmodel.arrays import FloatArray

MIN_Z = 3.0
"""Standard errors by which a hypothesis has to be better than another. Of about 1,500 faults
proposed in addition to the true ones, across gaps of 0.1 and 0.2, none reached 2."""

MIN_Z_OF_STEP = 2.0
"""Standard errors by which a further fault has to be better for a descent to continue. It is lower
than that of pruning, because another fault may be replaced afterwards. Without a bound, descents in
a wide space add faults that only pruning removes: ten times the simulations."""

MIN_Z_ACROSS_TRIALS = 5.0
"""Standard errors by which a mean loss has to exceed that of other trials. It is larger than
``MIN_Z`` because trials and gaits differ, and because hundreds of candidates are tested."""

MIN_Z_OF_ONE_GAIT = 3.5
"""Standard errors by which a mean loss has to exceed that of healthy trials with the same gait. Of
40 healthy recordings of another generator, the largest excess was 2.1."""

MIN_Z_OF_OTHER_GAITS = 6.0
"""The same for trials with other gaits, which may be harder to predict: of 8 healthy recordings,
the largest excess was 5.0."""

MIN_Z_OF_JOINT = 6.0
"""Standard errors by which the loss of a single joint has to exceed that in healthy trials for the
robot not to be intact. In 24 healthy recordings of another generator, the largest of all joints was
2.1, and in 24 with a fault of a joint, that joint had 4 to 53; with our own gap of 0.1, one healthy
joint had 5.0."""

MIN_EXCESS_OF_JOINT = 2.0
"""Standard errors by which the loss of a joint has to exceed that in healthy trials for a fault of
the joint to be searched. It is lower than ``MIN_Z_OF_JOINT``, because the gain of a fault is paired
over the pieces and so tested more sharply than the excess."""

MAX_LEFT_OF_JOINT = 0.5
"""Largest share of a joint's excess that an added fault may leave; one that leaves more is not the
cause."""

MIN_Z_OF_CHANGE = 5.0
"""Standard errors by which a hypothesis with a change in time has to be better than one without.
The threshold is higher than for a fault, because each time and each candidate is tested."""

MIN_PIECES = 8
"""Pieces before and after a change, and known pieces of a joint, at least."""

CHANGE_TOLERANCE = 2.0
"""Loss that the bounds of the interval of a change may cost, in mean differences of a piece."""

CONTRADICTION = 5.0
"""Loss of a piece in which the log contradicts a fault: as much as a signal whose error is 12 times
its scale. One glitch in 80 pieces then costs 0.06, and strong evidence outweighs it."""

LOSS_RATIO = 3.0
"""Ratio of mean losses that is significant whatever the standard error: a few segments are enough
where the prediction is almost exact."""

MIN_RATIO_OF_ONE = 1.1
"""Ratio of two losses by which a hypothesis is better where there is one alone, as of a comparator
with one distance per trial: a step of the search, and no proof."""

MIN_HEALTHY_SHARE = 0.1
"""Share of a gain that healthy trials with a fault of the self-model gain too. Two motors that were
invented in a steep walk gained 14 and 20 % of it in the healthy ones, at 4 standard errors."""

FAULTY_RATIO = 2.5
"""Loss of a hypothesis with faults over that of healthy trials that is much. Faults make a motion
harder to predict: a slipping foot, a body on the ground. So the excess alone does not count."""

NEGLIGIBLE_LOSS = 1e-6
"""Mean loss that counts as 0: the rounding errors of a model that equals the robot."""

LOSS_FLOOR = 1e-2
"""Excess of a mean loss over that of healthy trials that is never significant: errors of a tenth of
the scale of one signal. A ratio of smaller losses compares rounding errors, contacts that switch a
step early, and the one piece in which a robot changed."""

TEST = f"paired z over the pieces of the trials >= {MIN_Z:g}, or {LOSS_RATIO:g} times the loss"
"""Name of the test in reports and in JSON."""


def is_better(one: FloatArray, other: FloatArray, min_z: float = MIN_Z) -> bool:
    """Returns whether the first of two hypotheses leads by at least ``min_z``; see ``lead``."""
    return lead(one, other) >= min_z


def lead(one: FloatArray, other: FloatArray) -> float:
    """Returns by how many standard errors the first of two hypotheses predicts better.

    Args:
        one: Losses of the first hypothesis, ``(pieces,)``; infinite where a simulation diverged.
        other: Losses of the second hypothesis on the same pieces.

    Returns:
        The paired difference: 0 if the first one is not better, or diverged; infinite if the other
        one diverged, or has ``LOSS_RATIO`` times the loss, of a single piece ``MIN_RATIO_OF_ONE``
        times.
    """
    if not np.isfinite(one).all():
        return 0.0
    if not np.isfinite(other).all():
        return math.inf
    if not other.mean() > one.mean() + NEGLIGIBLE_LOSS:
        return 0.0
    ratio = LOSS_RATIO if len(one) > 1 else MIN_RATIO_OF_ONE
    has_ratio = other.mean() > ratio * one.mean() + NEGLIGIBLE_LOSS
    return math.inf if has_ratio else paired_z(other, one)


def joint_is_better(one: FloatArray, other: FloatArray) -> bool:
    """Returns whether the first losses of a joint are significantly smaller; see ``joint_lead``."""
    return joint_lead(one, other) >= MIN_Z


def joint_lead(one: FloatArray, other: FloatArray) -> float:
    """Returns by how many standard errors the first losses of a joint, ``(pieces,)``, are smaller.

    0 with fewer than ``MIN_PIECES`` pieces that are known (not NaN) in both.
    """
    smaller, larger = known(np.stack([one, other]))
    if len(smaller) < MIN_PIECES or not np.isfinite(smaller).all():
        return 0.0
    return paired_z(larger, smaller) if np.isfinite(larger).all() else math.inf


def known(rows: FloatArray) -> FloatArray:
    """Returns the pieces that are known in every row, ``(n, known pieces)``."""
    return np.asarray(rows[:, ~np.isnan(rows).any(axis=0)])


def paired_z(larger: FloatArray, smaller: FloatArray) -> float:
    """Returns the mean difference of finite losses divided by its standard error.

    The result is 0 for fewer than two pieces, and where all differences are equal.
    """
    difference = larger - smaller
    error = difference.std(ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return float(difference.mean() / error) if error > 0 else 0.0


def is_gain(one: FloatArray, other: FloatArray) -> bool:
    """Returns whether the first losses are smaller by ``MIN_Z_ACROSS_TRIALS`` standard errors."""
    return (
        bool(np.isfinite([one, other]).all())
        and (other - one).mean() > NEGLIGIBLE_LOSS
        and paired_z(other, one) >= MIN_Z_ACROSS_TRIALS
    )


def gain_exceeds_healthy_gain(
    one: FloatArray, other: FloatArray, healthy_one: FloatArray, healthy_other: FloatArray
) -> bool:
    """Returns whether a gain is significant, and significantly larger than on healthy trials.

    An equal gain on healthy trials is a correction of model error. So is a significant one of
    ``MIN_HEALTHY_SHARE``, since the trials may load a part more; a fault that came later makes
    healthy trials worse. The first two tests require ``MIN_Z_ACROSS_TRIALS`` standard errors,
    because hundreds of hypotheses are tested.

    Args:
        one: Losses of the better hypothesis on the damaged trials, ``(pieces,)``.
        other: Losses of the other hypothesis on the same pieces.
        healthy_one: As ``one``, on the healthy trials, ``(healthy pieces,)``.
        healthy_other: As ``other``, on the healthy trials.
    """
    if not (is_gain(one, other) and _are_comparable(healthy_one, healthy_other)):
        return False
    gain, more, _ = _gains(one, other, healthy_one, healthy_other)
    is_large = gain - more >= MIN_HEALTHY_SHARE * gain
    if is_large and is_better(healthy_one, healthy_other):
        return False
    return contrast(one, other, healthy_one, healthy_other) >= MIN_Z_ACROSS_TRIALS


def contrast(
    one: FloatArray, other: FloatArray, healthy_one: FloatArray, healthy_other: FloatArray
) -> float:
    """Returns by how many standard errors a gain exceeds that on healthy trials; 0 for no gain.

    The arguments are those of ``gain_exceeds_healthy_gain``.
    """
    if not _are_comparable(one, other, healthy_one, healthy_other):
        return 0.0
    gain, more, error = _gains(one, other, healthy_one, healthy_other)
    return more / error if gain > NEGLIGIBLE_LOSS and error > 0 else 0.0


def gain_is_model_error(
    one: FloatArray, other: FloatArray, healthy_one: FloatArray, healthy_other: FloatArray
) -> bool:
    """Returns whether a gain corrects model error: healthy trials gain about as much.

    Three conditions hold: the healthy trials gain; the damaged trials gain by less than ``MIN_Z``
    standard errors more; and the test has the power to show a real fault, which would worsen the
    healthy trials by as much as it improves the damaged ones.
    """
    if not _are_comparable(one, other, healthy_one, healthy_other):
        return False
    gain, more, error = _gains(one, other, healthy_one, healthy_other)
    healthy_gain = float((healthy_other - healthy_one).mean())
    return healthy_gain > NEGLIGIBLE_LOSS and more < MIN_Z * error < 2 * gain


def _are_comparable(one: FloatArray, *others: FloatArray) -> bool:
    """Returns whether all losses are finite, of two or more pieces each."""
    return all(len(each) > 1 and np.isfinite(each).all() for each in (one, *others))


def _gains(
    one: FloatArray, other: FloatArray, healthy_one: FloatArray, healthy_other: FloatArray
) -> tuple[float, float, float]:
    """Mean gain, its excess over that on the healthy trials, and the excess's standard error."""
    gains = other - one
    return (float(gains.mean()), *_welch(gains, healthy_other - healthy_one))


def excess_over_healthy(losses: FloatArray, healthy: FloatArray) -> float:
    """Returns the excess of a mean loss over that of healthy trials, in standard errors.

    It is Welch's statistic; 0 if the means differ by at most ``LOSS_FLOOR``, and infinite without
    variance. With a single piece, or with infinite losses: infinite if the ratio of the means is
    significant, else 0.
    """
    if min(len(losses), len(healthy)) < 2 or not np.isfinite([losses.mean(), healthy.mean()]).all():
        larger = losses.mean() > LOSS_RATIO * healthy.mean() + LOSS_FLOOR
        return math.inf if larger else 0.0
    difference, error = _welch(losses, healthy)
    if difference <= LOSS_FLOOR:
        return 0.0
    return difference / error if error > 0 else math.inf


def share_left(loss: float, intact_loss: float, healthy_loss: float) -> float | None:
    """Returns the share of the loss beyond that of healthy trials that a hypothesis leaves, 0 to 1.

    None if the empty hypothesis has no such loss.
    """
    beyond = intact_loss - healthy_loss
    return min(max((loss - healthy_loss) / beyond, 0.0), 1.0) if beyond > 0 else None


def _welch(one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """Difference of the means and its standard error (Welch)."""
    variance = one.var(ddof=1) / len(one) + other.var(ddof=1) / len(other)
    return float(one.mean() - other.mean()), float(np.sqrt(variance))
