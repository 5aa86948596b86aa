"""95 % confidence intervals of a proportion and of a ratio of paired means."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from selfmodel.arrays import FloatArray

CONFIDENCE = 0.95
RESAMPLES = 2000


@dataclass(frozen=True)
class Interval:
    """Estimate with its 95 % confidence interval.

    Attributes:
        estimate: The estimate; NaN without data.
        low: Lower end of the interval.
        high: Upper end of the interval.
    """

    estimate: float
    low: float
    high: float


def proportion(successes: int, trials: int) -> Interval:
    """Returns a proportion of successes with Wilson's score interval.

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference*,
    JASA 22 (1927), without a correction for continuity.

    Args:
        successes: Number of successes.
        trials: Number of trials; for 0 trials the estimate is NaN and the interval 0 to 1.

    Raises:
        ValueError: The number of successes is negative or above the number of trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"expected 0 to {trials} successes in {trials} trials, got {successes}")
    if not trials:
        return Interval(math.nan, 0.0, 1.0)
    wilson = stats.binomtest(successes, trials).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / trials, float(wilson.low), float(wilson.high))


def ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """Returns the ratio of the means of pairs, with a percentile bootstrap interval.

    Pairs are resampled together, with the same seed in every call, so that the same numbers give
    the same interval.

    Source: B. Efron and R. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.

    Args:
        numerators: One number per pair.
        denominators: One number per pair, above 0.

    Returns:
        Estimate and interval; both are NaN without pairs, and the interval is NaN for one pair.

    Raises:
        ValueError: The lengths differ, or a denominator is not above 0.
    """
    above, below = np.array(numerators, dtype=float), np.array(denominators, dtype=float)
    if above.shape != below.shape or not np.all(below > 0):
        raise ValueError(
            f"expected as many denominators above 0 as numerators, got {list(numerators)} over "
            f"{list(denominators)}"
        )
    if not len(above):
        return Interval(math.nan, math.nan, math.nan)
    estimate = float(above.mean() / below.mean())
    if len(above) == 1:
        return Interval(estimate, math.nan, math.nan)
    return Interval(estimate, *bootstrap_ratio(above, below, np.random.default_rng(0)))


def bootstrap_ratio(
    numerators: FloatArray, denominators: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    """Returns the ends of a percentile bootstrap interval of a ratio of means.

    Args:
        numerators: One number per pair, ``(pairs,)``.
        denominators: One number per pair, ``(pairs,)``.
        rng: Draws the pairs.
    """
    found = stats.bootstrap(
        (numerators, denominators),
        lambda above, below, axis: above.mean(axis=axis) / below.mean(axis=axis),
        paired=True,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=rng,
    ).confidence_interval
    return float(found.low), float(found.high)
