"""Tests of the paired tests: exact p values, symmetric in the methods."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from selfmodel.experiments.statistics.paired_tests import (
    MAX_EXACT,
    exact_mcnemar,
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
