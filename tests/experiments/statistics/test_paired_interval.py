"""Tests of the interval of a paired difference."""

import math

import numpy as np
import pytest

from selfmodel.experiments.statistics.paired_interval import (
    matched_proportions,
    paired_interval,
    paired_proportion_interval,
)


def interval(differences: list[float], seeds: list[int]) -> tuple[float, float, float]:
    found = paired_interval(differences, seeds, np.random.default_rng(0))
    return found.estimate, found.low, found.high


def proportion(differences: list[float], seeds: list[int]) -> tuple[float, float, float]:
    found = paired_proportion_interval(differences, seeds, np.random.default_rng(0))
    return found.estimate, found.low, found.high


def test_the_interval_is_around_the_mean_and_the_same_in_every_call():
    differences, seeds = list(np.random.default_rng(1).normal(1, 1, 40)), [k % 8 for k in range(40)]
    mean, low, high = interval(differences, seeds)

    assert mean == pytest.approx(np.mean(differences))
    assert low < mean < high
    assert (mean, low, high) == interval(differences, seeds)


def test_runs_of_one_seed_that_agree_count_as_few():
    by_seed = list(np.random.default_rng(1).normal(0.5, 1, 10))
    _, low, high = interval(by_seed, list(range(10)))
    _, repeated_low, repeated_high = interval(
        [d for d in by_seed for _ in range(9)], [seed for seed in range(10) for _ in range(9)]
    )

    assert (repeated_low, repeated_high) == pytest.approx((low, high))


def test_an_interval_of_few_seeds_is_about_as_wide_as_students():
    differences = list(np.random.default_rng(2).normal(0, 1, 5))
    _, low, high = interval(differences, list(range(5)))
    half = 2.776 * np.std(differences, ddof=1) / math.sqrt(5)

    assert high - low == pytest.approx(2 * half, rel=0.15)


def test_without_a_discordant_run_a_difference_is_not_known_exactly():
    mean, low, high = proportion([0.0] * 36, [k % 4 for k in range(36)])

    assert mean == 0
    assert low == pytest.approx(-high)
    assert 0.02 < high < 0.15


def test_a_difference_of_proportions_stays_within_one():
    _, low, high = proportion([1.0] * 6, [0, 1, 2, 0, 1, 2])

    assert 0 < low < high == 1


def test_one_seed_has_a_mean_and_no_interval():
    for found in (interval([1.0, 0.0], [3, 3]), proportion([1.0, 0.0], [3, 3])):
        assert found[0] == 0.5
        assert all(map(math.isnan, found[1:]))


def test_the_interval_of_matched_proportions_is_that_of_bonett_and_price():
    # (f12 + 1) / (n + 2) and (f21 + 1) / (n + 2), as in their equation.
    found = matched_proportions(5, 1, 20)
    first, second = 6 / 22, 2 / 22
    half = 1.95996 * math.sqrt((first + second - (first - second) ** 2) / 22)

    assert found.estimate == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx(
        (first - second - half, first - second + half), abs=1e-4
    )


def test_a_seed_per_difference_is_needed():
    with pytest.raises(ValueError, match="got 1 for 2"):
        interval([1.0, 2.0], [0])


def test_a_missing_difference_is_refused():
    with pytest.raises(ValueError, match="expected finite differences, got nan at place 1"):
        interval([1.0, math.nan], [0, 1])
