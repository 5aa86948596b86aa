"""Tests of the hypothesis that two methods are equally good, from paired outcomes."""

import itertools
import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy import stats

from selfmodel.arrays import FloatArray
from selfmodel.experiments.statistics.finite import finite

MAX_EXACT = 14
"""Largest number of differences whose signs are all enumerated."""

FLIPS = 20_000
"""Number of random sign vectors for more differences."""


def exact_mcnemar(first: Sequence[bool], second: Sequence[bool]) -> float:
    """Returns the two-sided p of the exact McNemar test.

    The runs in which only one method is right are a fair coin's throws if both are equally good.

    Assumption: the runs are independent of each other. Runs of one seed share gaits, so p is too
    small where they succeed and fail together; ``seed_test`` counts seeds.

    Source: Q. McNemar, *Note on the sampling error of the difference between correlated
    proportions or percentages*, Psychometrika 12 (1947); the binomial test is exact.

    Args:
        first: Whether the first method was right, by run.
        second: Whether the second method was right in the same runs.
    """
    only_first = sum(a and not b for a, b in zip(first, second, strict=True))
    only_second = sum(b and not a for a, b in zip(first, second, strict=True))
    if not only_first + only_second:
        return 1.0
    return float(stats.binomtest(only_first, only_first + only_second).pvalue)


def sign_flip_test(differences: Sequence[float], rng: np.random.Generator) -> float:
    """Returns the two-sided p of the permutation test that flips the signs of differences.

    The smallest p of n differences is 2 to the power of 1 - n: 0.125 with four.

    Assumption: if both methods are equally good, each difference is as likely with the other sign,
    independently of the others.

    Source: R. A. Fisher, *The Design of Experiments* (1935), section 21.

    Args:
        differences: First minus second, one per independent unit.
        rng: Draws signs if there are more than ``MAX_EXACT`` differences that are not 0.

    Raises:
        ValueError: A difference is NaN or infinite.
    """
    values = finite("differences", differences)
    values = values[values != 0]
    if not len(values):
        return 1.0
    if len(values) <= MAX_EXACT:
        sums, extra = _all_signs(len(values)) @ values, 0
    else:
        sums, extra = rng.choice((-1.0, 1.0), (FLIPS, len(values))) @ values, 1
    # A sum of the same numbers in another order may differ by roundings.
    limit = abs(values.sum()) - 1e-9 * np.abs(values).sum()
    return float((np.count_nonzero(np.abs(sums) >= limit) + extra) / (len(sums) + extra))


def seed_test(differences: Sequence[float], seeds: Sequence[int]) -> float:
    """Returns the two-sided p of Student's paired test over the means of the seeds.

    Assumption: the means of the seeds are independent and normal; runs of one seed may depend on
    each other. The means of few runs may be equal by chance, and p is then too small: a test over
    runs is needed too.

    Source: Student, *The probable error of a mean*, Biometrika 6 (1908).

    Args:
        differences: First minus second, one per run.
        seeds: Seed of each run.

    Returns:
        p; 1 with fewer than two seeds, or if the mean of the means is 0.

    Raises:
        ValueError: A difference is NaN or infinite.
    """
    values, groups = finite("differences", differences), np.array(seeds)
    means = np.array([values[groups == seed].mean() for seed in np.unique(groups)])
    if len(means) < 2:
        return 1.0
    mean = abs(float(means.mean()))
    # Means that are 0 apart from roundings do not differ, also if they have no error.
    if mean <= 1e-12 * float(np.abs(values).max()):
        return 1.0
    error = float(means.std(ddof=1)) / math.sqrt(len(means))
    if error <= 1e-12 * mean:
        return 0.0
    return float(2 * stats.t.sf(mean / error, len(means) - 1))


@cache
def _all_signs(count: int) -> FloatArray:
    """All vectors of signs, ``(2 ** count, count)``."""
    return np.array(list(itertools.product((-1.0, 1.0), repeat=count)))
