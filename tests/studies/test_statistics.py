"""Intervals and tests of plain numbers: known values, and what must hold for any."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from selfmodel.studies.statistics import (
    MAX_EXACT,
    Interval,
    exact_mcnemar,
    holm,
    matched_proportions,
    paired_interval,
    paired_proportion_interval,
    proportion,
    ratio,
    seed_test,
    sign_flip_test,
)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@given(st.lists(st.sampled_from([-1.0, 0.0, 1.0]), max_size=MAX_EXACT))
def test_mcnemar_is_the_sign_flip_test_of_right_and_wrong(differences: list[float]):
    counts = differences.count(1.0), differences.count(-1.0)

    assert exact_mcnemar(*counts) == exact_mcnemar(*counts[::-1])
    assert exact_mcnemar(*counts) == pytest.approx(sign_flip_test(differences, rng()))


def test_mcnemar_counts_the_runs_in_which_one_method_alone_is_right():
    assert exact_mcnemar(6, 0) == pytest.approx(2 / 2**6)  # six heads of six throws
    assert exact_mcnemar(0, 0) == 1


@given(st.lists(st.floats(-10, 10).map(lambda x: round(x, 3)), min_size=2, max_size=8).filter(any))
def test_the_sign_flip_test_of_few_numbers_is_that_of_scipy(differences: list[float]):
    theirs = stats.permutation_test(
        (differences,), np.mean, permutation_type="samples", n_resamples=np.inf
    )

    assert sign_flip_test(differences, rng()) == pytest.approx(float(theirs.pvalue), abs=1e-9)


def test_many_differences_are_flipped_at_random_with_the_same_result_in_every_call():
    differences = list(np.random.default_rng(1).normal(0.6, 1.0, 30))
    found = [sign_flip_test(differences, rng()) for _ in range(2)]

    assert found[0] == found[1] == pytest.approx(stats.ttest_1samp(differences, 0).pvalue, abs=0.01)


@pytest.mark.parametrize(
    ("differences", "seeds", "p"),
    [
        # Student's test of the means of the seeds.
        (
            [1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0],
            [0, 0, 1, 1, 2, 2, 3, 3],
            stats.ttest_1samp([0.5, 1.0, -0.5, 0.5], 0).pvalue,
        ),
        # The exact test of the means of the seeds, of few of them or without variance.
        ([1.0, 1.0], [0, 1], 2 / 2**2),
        ([1.0] * 9, [0, 1, 2] * 3, 2 / 2**3),
        ([1.0, 1.0, 1.0, 0.99], [0, 1, 2, 2], 2 / 2**3),
        ([1.0, 1.0, -0.01], [0, 1, 2], 4 / 2**3),
        ([0.1, 0.2, 0.2, 0.1] * 6, [n // 2 for n in range(24)], 2 / 2**12),
        ([0.0, 0.0], [0, 1], 1),
        ([1.0, 1.0], [5, 5], 1),  # one seed
        ([1.0, -1.0] * 4, [0, 0, 1, 1, 2, 2, 3, 3], 1),  # each wins as often in every seed
        ([0.1, 0.2, -0.3] * 4, [0] * 3 + [1] * 3 + [2] * 3 + [3] * 3, 1),  # roundings
    ],
)
def test_the_test_over_seeds(differences: list[float], seeds: list[int], p: float):
    assert seed_test(differences, seeds) == pytest.approx(p)


def test_a_missing_number_is_refused_as_it_would_count_as_certain():
    missing = [1.0, math.nan]

    with pytest.raises(ValueError, match="expected finite differences, got nan at place 1"):
        sign_flip_test(missing, rng())
    with pytest.raises(ValueError, match="expected finite differences"):
        seed_test(missing, [0, 1])
    with pytest.raises(ValueError, match="expected finite differences"):
        paired_interval(missing, [0, 1], rng())
    with pytest.raises(ValueError, match="got 1 for 2"):
        paired_interval([1.0, 2.0], [0], rng())
    for wrong in (math.nan, -0.1, 1.1):
        with pytest.raises(ValueError, match=r"expected .*p values"):
            holm([0.01, wrong])


def test_an_interval_over_seeds_is_that_of_their_means_and_as_wide_as_students():
    means = list(np.random.default_rng(2).normal(0, 1, 5))
    alone = paired_interval(means, list(range(5)), rng())
    repeated = paired_interval(
        [mean for mean in means for _ in range(9)],
        [seed for seed in range(5) for _ in range(9)],
        rng(),
    )
    half = 2.776 * np.std(means, ddof=1) / math.sqrt(5)

    assert alone.estimate == pytest.approx(np.mean(means))
    assert (repeated.low, repeated.high) == pytest.approx((alone.low, alone.high))
    assert alone.high - alone.low == pytest.approx(2 * half, rel=0.15)


def test_the_interval_of_proportions_has_room_for_the_error_that_no_run_shows():
    none = paired_proportion_interval([0.0] * 36, [k % 4 for k in range(36)], rng())
    every = paired_proportion_interval([1.0] * 6, [0, 1, 2, 0, 1, 2], rng())

    assert none.low == pytest.approx(-none.high)
    assert 0.02 < none.high < 0.15
    assert 0 < every.low < every.high == 1


def test_one_seed_has_a_mean_and_no_interval():
    for method in (paired_interval, paired_proportion_interval):
        found = method([1.0, 0.0], [3, 3], rng())
        assert found.estimate == 0.5
        assert math.isnan(found.low)
        assert math.isnan(found.high)


def test_the_interval_of_matched_proportions_is_that_of_bonett_and_price():
    # (f12 + 1) / (n + 2) and (f21 + 1) / (n + 2), as in their equation.
    found = matched_proportions(5, 1, 20)
    first, second = 6 / 22, 2 / 22
    half = 1.95996 * math.sqrt((first + second - (first - second) ** 2) / 22)

    assert found.estimate == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx(
        (first - second - half, first - second + half), abs=1e-4
    )


def test_the_smallest_p_is_multiplied_by_the_number_of_tests_and_the_next_by_one_less():
    assert holm([0.04, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    assert holm([0.6, 0.9]) == [1, 1]
    assert holm([0.03]) == [0.03]
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), max_size=12))
def test_corrected_p_values_have_the_order_of_the_tests_and_are_never_smaller(values: list[float]):
    found = holm(values)
    ordered = [p for _, p in sorted(zip(values, found, strict=True))]

    assert ordered == sorted(ordered)
    assert all(new >= old for old, new in zip(values, found, strict=True))


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
    with pytest.raises(ValueError, match=f"expected 0 to {trials} successes"):
        proportion(trials + 1, trials)


def test_a_ratio_of_means_has_a_bootstrap_that_covers_the_truth_about_as_often_as_it_says():
    generator, covered = np.random.default_rng(3), 0
    for _ in range(50):
        below = generator.uniform(1, 2, 30)
        interval = ratio(list(3 * below + generator.normal(size=30)), list(below))
        covered += interval.low <= 3 <= interval.high

    assert 42 <= covered <= 50
    assert ratio([2.0, 4.0, 10.0], [1.0, 2.0, 5.0]) == Interval(2.0, 2.0, 2.0)
    assert (ratio([3.0], [2.0]).estimate, math.isnan(ratio([3.0], [2.0]).low)) == (1.5, True)
    assert math.isnan(ratio([], []).estimate)
    assert (proportion(0, 0).low, proportion(0, 0).high) == (0, 1)
    for above, below_zero in (([1.0], [0.0]), ([1.0, 2.0], [1.0])):
        with pytest.raises(ValueError, match="as many denominators above 0"):
            ratio(above, below_zero)
