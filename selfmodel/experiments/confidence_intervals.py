"""95 % intervals: of a proportion, and of a ratio of means over pairs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
RESAMPLES = 2000


@dataclass(frozen=True)
class Interval:
    """An estimate and the interval about it.

    Attributes:
        estimate: What was observed; NaN where nothing was.
        low: The lower end.
        high: The upper end.
    """

    estimate: float
    low: float
    high: float


def proportion(successes: int, trials: int) -> Interval:
    """Returns how often something succeeds, with Wilson's score interval.

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference*,
    JASA 22 (1927), without a correction for continuity.

    Args:
        successes: How often it did.
        trials: How often it could; of 0, nothing is known: NaN, between 0 and 1.

    Raises:
        ValueError: There are more successes than trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"expected 0 to {trials} successes in {trials} trials, got {successes}")
    if not trials:
        return Interval(math.nan, 0.0, 1.0)
    wilson = stats.binomtest(successes, trials).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / trials, float(wilson.low), float(wilson.high))


def ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """Returns the mean of one number over the mean of another, with a percentile bootstrap.

    The pairs are drawn anew together, from the same seed for every call: the same numbers give the
    same interval.

    Source: B. Efron and R. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.

    Args:
        numerators: One number a pair.
        denominators: As many, each above 0.

    Returns:
        NaN for no pairs; with a single one nothing is known of the interval, and its ends are NaN.

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
    found = stats.bootstrap(
        (above, below),
        lambda up, down, axis: up.mean(axis=axis) / down.mean(axis=axis),
        paired=True,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Interval(estimate, float(found.low), float(found.high))
