"""Promises of the intervals: known values, and what must hold for any."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.experiments.confidence_intervals import Interval, proportion, ratio


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_the_published_intervals(successes: int, trials: int, low: float, high: float):
    interval = proportion(successes, trials)

    assert interval.estimate == successes / trials
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 200).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_proportion_lies_in_its_interval_and_failures_mirror_it(counts: tuple[int, int]):
    successes, trials = counts
    interval, mirror = proportion(successes, trials), proportion(trials - successes, trials)

    assert 0 <= interval.low <= interval.estimate + 1e-12
    assert interval.estimate - 1e-12 <= interval.high <= 1
    assert (1 - mirror.high, 1 - mirror.low) == pytest.approx((interval.low, interval.high))


def test_of_nothing_nothing_is_known():
    assert math.isnan(proportion(0, 0).estimate)
    assert math.isnan(ratio([], []).estimate)
    assert math.isnan(ratio([3.0], [2.0]).low)
    assert ratio([3.0], [2.0]).estimate == 1.5


def test_a_constant_ratio_is_known_exactly():
    denominators = [1.0, 2.0, 5.0]

    assert ratio([2.0, 4.0, 10.0], denominators) == Interval(2.0, 2.0, 2.0)


def test_a_bootstrap_covers_the_truth_about_as_often_as_it_says():
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(100):
        below = rng.uniform(1, 2, 30)
        interval = ratio(list(3 * below + rng.normal(size=30)), list(below))
        covered += interval.low <= 3 <= interval.high

    assert 86 <= covered <= 100


@pytest.mark.parametrize(("above", "below"), [([1.0], [0.0]), ([1.0, 2.0], [1.0])])
def test_what_is_no_ratio_is_refused(above: list[float], below: list[float]):
    with pytest.raises(ValueError, match="as many denominators above 0"):
        ratio(above, below)


def test_more_successes_than_trials_are_refused():
    with pytest.raises(ValueError, match="expected 0 to 3 successes"):
        proportion(4, 3)
