"""Tests of the significance tests: pairing, rounding errors, infinite losses."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from selfmodel.diagnosis.significance import (
    LOSS_FLOOR,
    LOSS_RATIO,
    MIN_HEALTHY_SHARE,
    MIN_PIECES,
    MIN_Z,
    MIN_Z_ACROSS_TRIALS,
    NEGLIGIBLE_LOSS,
    excess_over_healthy,
    gain_exceeds_healthy_gain,
    gain_is_model_error,
    is_better,
    joint_is_better,
    paired_z,
)

LOSSES = st.one_of(st.just(np.inf), st.floats(0, 1e6))
DIVERGED = np.full(5, np.inf)


def exceeds(losses: np.ndarray, healthy: np.ndarray) -> bool:
    """Returns whether the verdict about losses with this excess is ``unexplained``."""
    return excess_over_healthy(losses, healthy) > MIN_Z_ACROSS_TRIALS


def of_mean_and_error(mean: float, error: float, pieces: int = 100) -> np.ndarray:
    """Losses with a given mean and standard error of the mean."""
    swing = np.tile([-1.0, 1.0], pieces // 2)
    return mean + swing / swing.std(ddof=1) * error * np.sqrt(pieces)


def test_the_paired_z_is_the_statistic_of_the_paired_t_test():
    rng = np.random.default_rng(0)
    one, other = rng.gamma(2, size=(2, 37))

    assert paired_z(one, other) == pytest.approx(stats.ttest_rel(one, other).statistic)


def test_what_makes_a_piece_hard_for_both_does_not_count():
    hard = np.linspace(0, 1e3, 100)
    by_two_percent = of_mean_and_error(0.02, 0.001)

    assert is_better(hard + 1, hard + 1 + by_two_percent)
    assert not is_better(hard + 1, np.roll(hard, 50) + 1 + by_two_percent)


@pytest.mark.parametrize(("errors", "told"), [(MIN_Z * 1.01, True), (MIN_Z * 0.99, False)])
def test_a_difference_counts_from_three_standard_errors_on(errors: float, told: bool):  # noqa: FBT001  # what is expected
    one = np.full(100, 10.0)

    assert is_better(one, one + of_mean_and_error(errors * 0.1, 0.1)) == told


@pytest.mark.parametrize(("times", "told"), [(LOSS_RATIO * 1.01, True), (LOSS_RATIO * 0.99, False)])
def test_three_times_the_loss_counts_whatever_the_errors(times: float, told: bool):  # noqa: FBT001  # what is expected
    # The whole difference is in one segment of a hundred: z is 1.
    one = np.full(100, 0.01)
    other = one.copy()
    other[7] += (times - 1) * one.sum()

    assert paired_z(other, one) == pytest.approx(1)
    assert is_better(one, other) == told
    assert not exceeds(other, one), "between trials, a ratio alone is no evidence"


def test_the_rounding_of_arithmetic_is_no_reason():
    perfect, rounded = np.zeros(2), np.array([0.0, 1.9 * NEGLIGIBLE_LOSS])

    assert not is_better(perfect, rounded)
    assert is_better(perfect, 2 * rounded)


def test_an_excess_below_the_floor_is_none_however_exact_the_prediction():
    healthy = np.full(50, 1e-7)

    assert exceeds(healthy + 1.01 * LOSS_FLOOR, healthy)
    assert excess_over_healthy(healthy + 0.99 * LOSS_FLOOR, healthy) == 0
    assert not exceeds(np.array([0.99 * LOSS_FLOOR]), np.zeros(1))
    assert exceeds(np.array([1.01 * LOSS_FLOOR]), np.zeros(1))


@pytest.mark.parametrize("better", [is_better, joint_is_better])
def test_whatever_predicts_at_all_is_better_than_what_diverged(better: Callable[..., bool]):
    finite, diverged = np.full(MIN_PIECES, 1e9), np.full(MIN_PIECES, np.inf)

    assert better(finite, diverged)
    assert not better(diverged, finite)
    assert not better(diverged, diverged)


@pytest.mark.parametrize(("pieces", "better"), [(MIN_PIECES - 1, False), (MIN_PIECES, True)])
def test_a_few_pieces_of_a_joint_are_no_evidence(pieces: int, *, better: bool):
    few, large = np.full(80, np.nan), np.linspace(1, 2, 80)
    few[:pieces] = np.linspace(0.1, 0.2, pieces)

    assert joint_is_better(few, large) == better
    assert not joint_is_better(large, few)


def test_losses_of_other_trials_are_compared_as_welch_did():
    rng = np.random.default_rng(1)
    usual, losses = rng.normal(10, 1, 40), rng.normal(11, 3, 80)
    z = stats.ttest_ind(losses, usual, equal_var=False).statistic
    lift = (MIN_Z_ACROSS_TRIALS - z) * (losses.mean() - usual.mean()) / z

    assert excess_over_healthy(losses, usual) == pytest.approx(z)
    assert not exceeds(losses + 0.99 * lift, usual)
    assert exceeds(losses + 1.01 * lift, usual)
    assert not exceeds(losses - 5, usual)


@given(arrays(float, (2, 6), elements=LOSSES))
def test_of_two_at_most_one_is_better(pair: np.ndarray):
    one, other = pair

    assert not (is_better(one, other) and is_better(other, one))
    assert not is_better(one, one)
    assert not exceeds(one, one)


@pytest.mark.parametrize(
    ("errors", "told"), [(MIN_Z_ACROSS_TRIALS * 1.01, True), (MIN_Z_ACROSS_TRIALS * 0.99, False)]
)
def test_what_became_better_did_so_by_five_standard_errors(errors: float, told: bool):  # noqa: FBT001  # what is expected
    one, before = np.full(100, 10.0), np.full(100, 10.0)
    other = one + of_mean_and_error(errors * 0.1, 0.1)

    assert gain_exceeds_healthy_gain(one, other, before, before) == told
    assert not gain_exceeds_healthy_gain(other, one, before, before)


def at_the_edge(errors: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Losses, gains on healthy trials, and gains that exceed them by some standard errors."""
    rng = np.random.default_rng(2)
    one, gain, earlier = rng.normal(10, 1, 80), rng.normal(0.2, 0.3, 80), rng.normal(0.1, 0.3, 40)
    assert 0 < paired_z(earlier, np.zeros(40)) < MIN_Z
    z = stats.ttest_ind(gain, earlier, equal_var=False).statistic
    assert 0 < z < errors
    return one, earlier, gain + (errors - z) * (gain.mean() - earlier.mean()) / z


BEFORE = np.full(40, 10.0)


def test_what_was_better_before_has_to_be_better_by_more_since():
    one, earlier, gain = at_the_edge(MIN_Z_ACROSS_TRIALS)

    assert paired_z(one + gain, one) > MIN_Z_ACROSS_TRIALS
    assert not gain_exceeds_healthy_gain(one, one + gain - 0.002, BEFORE, BEFORE + earlier)
    assert gain_exceeds_healthy_gain(one, one + gain + 0.002, BEFORE, BEFORE + earlier)


@pytest.mark.parametrize(
    ("errors", "share", "told"),
    [(1.01, 1.01, False), (0.99, 1.01, True), (1.01, 0.99, True)],
)
def test_what_gained_before_significantly_and_by_a_tenth_is_no_gain_since(
    errors: float,
    share: float,
    told: bool,  # noqa: FBT001  # what is expected
):
    one, gain = np.full(40, 10.0), 0.5 + 0.001 * np.resize([1.0, -1.0], 40)
    size = share * MIN_HEALTHY_SHARE * gain.mean()
    before = np.full(100, 10.0), 10.0 + of_mean_and_error(size, size / (errors * MIN_Z))

    assert gain_exceeds_healthy_gain(one, one + gain, *before) == told


@pytest.mark.parametrize("has_helped", [False, True])
def test_what_diverged_or_has_a_single_piece_neither_became_better_nor_mends(*, has_helped: bool):
    one, other = np.zeros(5), np.linspace(1.0, 1.1, 5)
    before = other if has_helped else one
    told = gain_is_model_error if has_helped else gain_exceeds_healthy_gain

    assert told(one, other, one, before)
    assert not told(one, DIVERGED, one, before)
    assert not told(one, other, one, DIVERGED)
    assert not told(one[:1], other[:1], one, before)
    assert not told(one, other, one[:1], before[:1])


def test_a_gain_of_rounding_errors_is_none():
    one, other = np.zeros(5), np.linspace(1.0, 1.1, 5)

    assert not gain_exceeds_healthy_gain(one, other * NEGLIGIBLE_LOSS / 2, one, one)


def test_what_helped_before_only_mends_unless_it_helps_significantly_more_since():
    one, earlier, gain = at_the_edge(MIN_Z)

    assert gain_is_model_error(one, one + gain - 0.002, BEFORE, BEFORE + earlier)
    assert not gain_is_model_error(one, one + gain + 0.002, BEFORE, BEFORE + earlier)


@pytest.mark.parametrize("harm", [0.0, NEGLIGIBLE_LOSS / 2, 1.0])
def test_what_did_not_help_before_does_not_mend_however_little_it_helps_since(harm: float):
    one, before = np.full(100, 10.0), np.full(100, 10.0)
    hardly = one + of_mean_and_error(0.2, 0.1)

    assert not gain_is_model_error(one, hardly, before, before - harm)
    assert gain_is_model_error(one, hardly, before, before + 2 * NEGLIGIBLE_LOSS)


@pytest.mark.parametrize(("error", "told"), [(0.19, True), (0.21, False)])
def test_trials_that_would_not_have_shown_the_harm_say_nothing(error: float, told: bool):  # noqa: FBT001  # of a table
    # A harm as large as the gain is 0.6 below the gain: MIN_Z standard errors of 0.2.
    one, before = np.full(100, 10.0), np.full(100, 10.0)

    assert (
        gain_is_model_error(one, one + 0.3, before, before + of_mean_and_error(0.01, error)) == told
    )
