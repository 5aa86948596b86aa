"""95 % interval of the mean difference between two methods, from paired outcomes."""

import math
from collections.abc import Sequence

import numpy as np
from scipy import stats

from selfmodel.arrays import FloatArray
from selfmodel.experiments.confidence_intervals import CONFIDENCE, Interval, bootstrap_ratio
from selfmodel.experiments.statistics.finite import finite

TAIL = 0.5 + CONFIDENCE / 2
NORMAL = float(stats.norm.ppf(TAIL))


def paired_interval(
    differences: Sequence[float], seeds: Sequence[int], rng: np.random.Generator
) -> Interval:
    """Returns the mean of paired differences with a bootstrap interval over seeds.

    Seeds are drawn with all their runs. The ends are moved away from the mean by Student's quantile
    over the normal one and by the bias of a variance of few seeds, as a percentile bootstrap of
    n < 30 units is too narrow.

    Assumptions: the seeds are independent and drawn from one population; the cells are fixed, and
    every seed has nearly as many runs. Coverage by simulation: ``docs/results/statistics.md``.

    Source: B. Efron and R. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13; the
    correction for few units: T. Hesterberg, *What Teachers Should Know About the Bootstrap*, The
    American Statistician 69 (2015).

    Args:
        differences: First minus second, one per run.
        seeds: Seed of each run.
        rng: Draws the seeds.

    Returns:
        Mean and interval; the interval is NaN with fewer than two seeds.

    Raises:
        ValueError: A difference is NaN or infinite, or there is no seed for it.
    """
    values, groups = finite("differences", differences), np.array(seeds)
    if values.shape != groups.shape:
        raise ValueError(f"expected a seed per difference, got {len(groups)} for {len(values)}")
    if not len(values):
        return Interval(math.nan, math.nan, math.nan)
    mean = float(values.mean())
    members = groups == np.unique(groups)[:, None]
    if len(members) < 2:
        return Interval(mean, math.nan, math.nan)
    low, high = _over_seeds(members @ values, members.sum(axis=1).astype(float), mean, rng)
    return Interval(mean, low, high)


def paired_proportion_interval(
    differences: Sequence[float], seeds: Sequence[int], rng: np.random.Generator
) -> Interval:
    """Returns the difference of two paired proportions with an interval over seeds and runs.

    It is the smallest interval that contains ``paired_interval`` and ``matched_proportions``: a
    bootstrap alone cannot draw the rare error that no seed has shown, and has no width without one.

    Args:
        differences: -1, 0 or 1: first minus second, one per run.
        seeds: Seed of each run.
        rng: Draws the seeds.

    Returns:
        Difference and interval; the interval is NaN with fewer than two seeds.
    """
    found = paired_interval(differences, seeds, rng)
    if math.isnan(found.low):
        return found
    only_first, only_second = (sum(one == sign for one in differences) for sign in (1, -1))
    rare = matched_proportions(only_first, only_second, len(differences))
    low, high = min(found.low, rare.low), max(found.high, rare.high)
    return Interval(found.estimate, max(-1.0, low), min(1.0, high))


def _over_seeds(
    sums: FloatArray, counts: FloatArray, mean: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Returns the ends of the bootstrap interval over seeds.

    Args:
        sums: Sum of the differences of each seed.
        counts: Number of runs of each seed.
        mean: Mean difference.
        rng: Draws the seeds.
    """
    low, high = bootstrap_ratio(sums, counts, rng)
    number = len(sums)
    wider = math.sqrt(number / (number - 1)) * float(stats.t.ppf(TAIL, number - 1)) / NORMAL
    return mean - wider * (mean - low), mean + wider * (high - mean)


def matched_proportions(only_first: int, only_second: int, runs: int) -> Interval:
    """Returns the difference of two paired proportions with Bonett and Price's interval.

    Assumption: the runs are independent of each other.

    Source: D. G. Bonett and R. M. Price, *Adjusted Wald confidence interval for a difference of
    binomial proportions based on paired data*, Journal of Educational and Behavioral Statistics 37
    (2012).

    Args:
        only_first: Number of runs in which only the first method is right.
        only_second: Number of runs in which only the second method is right.
        runs: Number of runs.
    """
    first, second = (only_first + 1) / (runs + 2), (only_second + 1) / (runs + 2)
    middle = first - second
    half = NORMAL * math.sqrt((first + second - middle**2) / (runs + 2))
    estimate = (only_first - only_second) / runs
    return Interval(estimate, max(-1.0, middle - half), min(1.0, middle + half))
