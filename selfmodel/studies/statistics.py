"""Statistics of plain numbers: intervals, and tests of paired differences.

Assumptions, and errors and coverage by simulation: ``docs/results/statistics.md``. Numbers that are
not finite are refused: NaN would compare as no difference, or as a sure one.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from selfmodel.arrays import FloatArray

CONFIDENCE = 0.95
TAIL = 0.5 + CONFIDENCE / 2
NORMAL = float(stats.norm.ppf(TAIL))

RESAMPLES = 2000
"""Resamples of a bootstrap."""

MIN_SEEDS = 4
"""Smallest number of seeds of Student's test; with fewer it errs too often."""

MAX_EXACT, FLIPS = 14, 20_000
"""Largest number of differences whose signs are all enumerated; random sign vectors of more."""


@dataclass(frozen=True)
class Interval:
    """Estimate with the ends of its 95 % confidence interval; NaN where they are unknown."""

    estimate: float
    low: float = math.nan
    high: float = math.nan


UNKNOWN = Interval(math.nan)


def proportion(successes: int, trials: int) -> Interval:
    """Returns a proportion of successes with Wilson's score interval; 0 to 1 of no trials.

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference*,
    JASA 22 (1927), without a correction for continuity.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"expected 0 to {trials} successes in {trials} trials, got {successes}")
    if not trials:
        return Interval(math.nan, 0.0, 1.0)
    wilson = stats.binomtest(successes, trials).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / trials, float(wilson.low), float(wilson.high))


def ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """Returns the ratio of the means of pairs, with a percentile bootstrap interval over the pairs.

    The same numbers give the same interval in every call; one pair has none.

    Source: B. Efron and R. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.
    """
    above, below = np.array(numerators, dtype=float), np.array(denominators, dtype=float)
    if above.shape != below.shape or not np.all(below > 0):
        raise ValueError(
            f"expected as many denominators above 0 as numerators, got {list(numerators)} over "
            f"{list(denominators)}"
        )
    if not len(above):
        return UNKNOWN
    estimate = float(above.mean() / below.mean())
    if len(above) == 1:
        return Interval(estimate)
    return Interval(estimate, *_bootstrap_ratio(above, below, np.random.default_rng(0)))


def paired_interval(
    differences: Sequence[float], seeds: Sequence[int], rng: np.random.Generator
) -> Interval:
    """Returns the mean of paired differences with a bootstrap interval over seeds.

    Seeds are drawn with all their runs. The ends are moved away from the mean by Student's quantile
    over the normal one and by the bias of a variance of few seeds, as a percentile bootstrap of
    n < 30 units is too narrow. With fewer than two seeds, the interval is NaN.

    Source: B. Efron and R. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13; the
    correction for few units: T. Hesterberg, *What Teachers Should Know About the Bootstrap*, The
    American Statistician 69 (2015).
    """
    values, groups = _finite("differences", differences), np.array(seeds)
    if values.shape != groups.shape:
        raise ValueError(f"expected a seed per difference, got {len(groups)} for {len(values)}")
    if not len(values):
        return UNKNOWN
    mean = float(values.mean())
    members = groups == np.unique(groups)[:, None]
    number = len(members)
    if number < 2:
        return Interval(mean)
    low, high = _bootstrap_ratio(members @ values, members.sum(axis=1).astype(float), rng)
    wider = math.sqrt(number / (number - 1)) * float(stats.t.ppf(TAIL, number - 1)) / NORMAL
    return Interval(mean, mean - wider * (mean - low), mean + wider * (high - mean))


def paired_proportion_interval(
    differences: Sequence[float], seeds: Sequence[int], rng: np.random.Generator
) -> Interval:
    """Returns the mean of differences -1, 0 and 1 with an interval over seeds and runs.

    It is the smallest interval that contains ``paired_interval`` and ``matched_proportions``: a
    bootstrap alone cannot draw the rare error that no seed has shown, and has no width without one.
    """
    found = paired_interval(differences, seeds, rng)
    if math.isnan(found.low):
        return found
    only_first, only_second = (sum(one == sign for one in differences) for sign in (1, -1))
    rare = matched_proportions(only_first, only_second, len(differences))
    low, high = min(found.low, rare.low), max(found.high, rare.high)
    return Interval(found.estimate, max(-1.0, low), min(1.0, high))


def matched_proportions(only_first: int, only_second: int, runs: int) -> Interval:
    """Returns the difference of two paired proportions with Bonett and Price's interval.

    Source: D. G. Bonett and R. M. Price, *Adjusted Wald confidence interval for a difference of
    binomial proportions based on paired data*, Journal of Educational and Behavioral Statistics 37
    (2012). Given are the numbers of runs in which only one of the methods is right, and of all.
    """
    first, second = (only_first + 1) / (runs + 2), (only_second + 1) / (runs + 2)
    middle = first - second
    half = NORMAL * math.sqrt((first + second - middle**2) / (runs + 2))
    estimate = (only_first - only_second) / runs
    return Interval(estimate, max(-1.0, middle - half), min(1.0, middle + half))


def exact_mcnemar(only_first: int, only_second: int) -> float:
    """Returns the two-sided p of the exact McNemar test, from the numbers of discordant runs.

    Runs of one seed share gaits, so p is too small where they succeed and fail together.

    Source: Q. McNemar, *Note on the sampling error of the difference between correlated
    proportions or percentages*, Psychometrika 12 (1947); the binomial test is exact.
    """
    discordant = only_first + only_second
    return float(stats.binomtest(only_first, discordant).pvalue) if discordant else 1.0


def sign_flip_test(differences: Sequence[float], rng: np.random.Generator) -> float:
    """Returns the two-sided p of the permutation test that flips the signs of differences.

    Random signs are drawn for more than ``MAX_EXACT`` differences that are not 0.
    ``scipy.stats.permutation_test`` is the same test, with other random signs: its p would differ
    from published ones.

    Source: R. A. Fisher, *The Design of Experiments* (1935), section 21.
    """
    values = _finite("differences", differences)
    values = values[values != 0]
    if not len(values):
        return 1.0
    if len(values) <= MAX_EXACT:
        signs, extra = np.array(list(itertools.product((-1.0, 1.0), repeat=len(values)))), 0
    else:
        signs, extra = rng.choice((-1.0, 1.0), (FLIPS, len(values))), 1
    sums = np.abs(signs @ values)
    # A sum of the same numbers in another order may differ by roundings.
    limit = abs(values.sum()) - 1e-9 * np.abs(values).sum()
    return float((np.count_nonzero(sums >= limit) + extra) / (len(sums) + extra))


def seed_test(differences: Sequence[float], seeds: Sequence[int]) -> float:
    """Returns the two-sided p of Student's paired test over the means of the seeds.

    Of fewer than ``MIN_SEEDS``, and of means without variance, which its standard error would call
    certain, it is that of the exact sign-flip test of the means: 2 / 2^n for n seeds at least. The
    means of few runs may be equal by chance, and p is then too small: a test over runs is needed
    too.

    Source: Student, *The probable error of a mean*, Biometrika 6 (1908).
    """
    values, groups = _finite("differences", differences), np.array(seeds)
    means = np.array([values[groups == seed].mean() for seed in np.unique(groups)])
    # Means that are 0 apart from roundings do not differ, also if they have no error.
    if not len(means) or abs(means.mean()) <= 1e-12 * np.abs(values).max():
        return 1.0
    if len(means) < MIN_SEEDS or means.std(ddof=1) <= 1e-12 * abs(means.mean()):
        return sign_flip_test(means.tolist(), np.random.default_rng(0))
    return float(stats.ttest_1samp(means, 0.0).pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """Returns p values adjusted by Holm's method, in the order given.

    Source: S. Holm, *A simple sequentially rejective multiple test procedure*, Scandinavian Journal
    of Statistics 6 (1979).
    """
    given = _finite("p values", p_values)
    if np.any((given < 0) | (given > 1)):
        raise ValueError(f"expected p values from 0 to 1, got {list(p_values)}")
    order = np.argsort(given, kind="stable")
    steps = np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1))
    adjusted = np.empty(len(given))
    adjusted[order] = np.minimum(steps, 1.0)
    return [float(p) for p in adjusted]


def _bootstrap_ratio(
    numerators: FloatArray, denominators: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    """Returns the ends of a percentile bootstrap interval of a ratio of means of pairs."""
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


def _finite(what: str, values: Sequence[float]) -> FloatArray:
    found = np.array(values, dtype=float)
    if not np.isfinite(found).all():
        place = int(np.argmin(np.isfinite(found)))
        raise ValueError(
            f"expected finite {what}, got {found[place]} at place {place}: leave out runs without "
            f"a value"
        )
    return found
