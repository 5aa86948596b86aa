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

OUTCOMES = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=40)


def test_mcnemar_counts_the_runs_in_which_one_method_alone_is_right():
    # Six heads of six throws: 2 / 2^6, whatever the runs in which both agree.
    first, second = [True] * 16, [True] * 10 + [False] * 6

    assert exact_mcnemar(first, second) == pytest.approx(2 / 2**6)
    assert exact_mcnemar(first[10:], second[10:]) == pytest.approx(2 / 2**6)


def test_methods_that_are_right_in_the_same_runs_do_not_differ():
    assert exact_mcnemar([True, False], [True, False]) == 1
    assert exact_mcnemar([], []) == 1


@given(OUTCOMES)
def test_mcnemar_does_not_depend_on_which_method_is_first(outcomes: list[tuple[bool, bool]]):
    first, second = [a for a, _ in outcomes], [b for _, b in outcomes]

    assert exact_mcnemar(first, second) == exact_mcnemar(second, first)


@given(OUTCOMES.filter(lambda outcomes: sum(a != b for a, b in outcomes) <= MAX_EXACT))
def test_the_sign_flip_test_of_right_and_wrong_is_the_mcnemar_test(
    outcomes: list[tuple[bool, bool]],
):
    differences = [float(a) - float(b) for a, b in outcomes]
    p = sign_flip_test(differences, np.random.default_rng(0))

    assert p == pytest.approx(exact_mcnemar([a for a, _ in outcomes], [b for _, b in outcomes]))


@given(st.lists(st.floats(-10, 10).map(lambda x: round(x, 3)), min_size=2, max_size=8))
def test_the_sign_flip_test_of_few_numbers_is_that_of_scipy(differences: list[float]):
    if not any(differences):
        return
    theirs = stats.permutation_test(
        (differences,), np.mean, permutation_type="samples", n_resamples=np.inf
    )
    own = sign_flip_test(differences, np.random.default_rng(0))

    assert own == pytest.approx(float(theirs.pvalue), abs=1e-9)


def test_the_test_over_seeds_is_students_of_their_means():
    differences, seeds = [1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0], [0, 0, 1, 1, 2, 2, 3, 3]
    theirs = stats.ttest_1samp([0.5, 1.0, -0.5, 0.5], 0)

    assert seed_test(differences, seeds) == pytest.approx(float(theirs.pvalue))


def test_seeds_that_agree_leave_the_decision_to_the_test_over_runs():
    assert seed_test([1.0, 1.0], [0, 1]) == 0
    assert seed_test([0.0, 0.0], [0, 1]) == 1
    assert seed_test([1.0, 1.0], [5, 5]) == 1  # one seed


def test_methods_that_win_as_often_in_every_seed_do_not_differ():
    # In each seed, the first alone is right in one case, and the second alone in another.
    assert seed_test([1.0, -1.0] * 4, [0, 0, 1, 1, 2, 2, 3, 3]) == 1
    assert seed_test([1.0, -1.0, 0.0, 0.0], [0, 0, 1, 1]) == 1


def test_means_that_are_zero_but_for_roundings_do_not_differ():
    differences = [0.1, 0.2, -0.3]

    assert sum(differences) != 0
    assert seed_test(differences * 4, [seed for seed in range(4) for _ in differences]) == 1


def test_many_differences_are_flipped_at_random_with_the_same_result_in_every_call():
    differences = list(np.random.default_rng(1).normal(0.6, 1.0, 30))
    found = [sign_flip_test(differences, np.random.default_rng(0)) for _ in range(2)]

    assert found[0] == found[1]
    assert found[0] == pytest.approx(stats.ttest_1samp(differences, 0).pvalue, abs=0.01)


def test_a_missing_difference_is_refused_as_it_would_count_as_certain():
    missing = [float("nan"), 1.0]

    with pytest.raises(ValueError, match="expected finite differences, got nan at place 0"):
        sign_flip_test(missing, np.random.default_rng(0))
    with pytest.raises(ValueError, match="expected finite differences"):
        seed_test(missing, [0, 1])


def interval(differences: list[float], seeds: list[int]) -> tuple[float, float, float]:
    found = paired_interval(differences, seeds, np.random.default_rng(0))
    return found.estimate, found.low, found.high


def of_shares(differences: list[float], seeds: list[int]) -> tuple[float, float, float]:
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
    mean, low, high = of_shares([0.0] * 36, [k % 4 for k in range(36)])

    assert mean == 0
    assert low == pytest.approx(-high)
    assert 0.02 < high < 0.15


def test_a_difference_of_proportions_stays_within_one():
    _, low, high = of_shares([1.0] * 6, [0, 1, 2, 0, 1, 2])

    assert 0 < low < high == 1


def test_one_seed_has_a_mean_and_no_interval():
    for found in (interval([1.0, 0.0], [3, 3]), of_shares([1.0, 0.0], [3, 3])):
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


P_VALUES = st.lists(st.floats(0, 1), max_size=12)


def test_the_smallest_p_is_multiplied_by_the_number_of_tests_and_the_next_by_one_less():
    assert holm([0.04, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])


def test_a_corrected_p_is_at_most_one_and_one_test_needs_no_correction():
    assert holm([0.6, 0.9]) == [1, 1]
    assert holm([0.03]) == [0.03]
    assert holm([]) == []


@given(P_VALUES)
def test_corrected_p_values_have_the_order_of_the_tests_and_are_never_smaller(values: list[float]):
    found = holm(values)
    ordered = [p for _, p in sorted(zip(values, found, strict=True))]

    assert ordered == sorted(ordered)
    assert all(new >= old for old, new in zip(values, found, strict=True))


@pytest.mark.parametrize("wrong", [float("nan"), -0.1, 1.1])
def test_a_number_that_is_no_p_is_refused(wrong: float):
    with pytest.raises(ValueError, match=r"expected .*p values"):
        holm([0.01, wrong])


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
