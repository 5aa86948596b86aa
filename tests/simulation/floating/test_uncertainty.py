"""Promises of the uncertainty of a calibration: the noise of contacts is no information."""

import numpy as np

from selfmodel.simulation.floating.uncertainty import (
    UNDETERMINED_SHARE,
    consistent_information,
    determined,
)


def test_noise_of_finite_differences_is_no_information():
    rng = np.random.default_rng(0)
    ahead, behind = rng.standard_normal((2, 100_000, 2))

    information = consistent_information(ahead, behind)
    assert np.abs(information).max() < 0.02 * np.diag(ahead.T @ ahead).min()


def test_equal_slopes_are_fisher_information_under_any_noise():
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((100_000, 2)) * [1.0, 0.1]
    noise = rng.standard_normal((2, *slopes.shape))
    expected = slopes.T @ slopes

    np.testing.assert_allclose(consistent_information(slopes, slopes), expected, rtol=1e-9)
    noisy = consistent_information(slopes + noise[0], slopes + noise[1])
    np.testing.assert_allclose(np.diag(noisy), np.diag(expected), rtol=0.5)


def test_information_is_never_negative():
    slopes = np.random.default_rng(2).standard_normal((50, 3))

    assert np.linalg.eigvalsh(consistent_information(slopes, -slopes)).min() >= -1e-9


def test_a_parameter_is_determined_if_the_trials_halve_its_variance():
    prior = np.array([0.15, 0.3])

    assert determined(UNDETERMINED_SHARE * prior * 0.99, prior) == (True, True)
    assert determined(UNDETERMINED_SHARE * prior * 1.01, prior) == (False, False)
