"""Promises of fits: their sets, and that the noise of contacts is no information."""

import dataclasses

import numpy as np
import pytest

from selfmodel.robot.robot import Robot
from selfmodel.simulation.factor_sets import bases, prior_deviations
from selfmodel.simulation.fit import UNDETERMINED_SHARE, consistent_information, is_determined
from selfmodel.simulation.model_factors import nominal
from selfmodel.tasks import ROBOTS
from tests.helpers.robots.arms import arm


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

    assert is_determined(UNDETERMINED_SHARE * prior * 0.99, prior).all()
    assert not is_determined(UNDETERMINED_SHARE * prior * 1.01, prior).any()


@pytest.mark.parametrize("robot", [arm(), ROBOTS["quadruped"].robot()], ids=lambda own: own.name)
def test_the_coordinates_of_a_set_are_those_of_its_parameters(robot: Robot):
    start = dataclasses.replace(nominal(robot), delay=1, contact_damping=0.5)
    prior, sizes = prior_deviations(robot), []
    for _, basis in bases(robot):
        x = np.linspace(-0.5, 0.5, len(basis.prior))
        applied = basis.applied(start, x)
        sizes.append(len(x))

        np.testing.assert_allclose(basis.coordinates(applied), x, atol=1e-12)
        assert (applied.delay, applied.contact_damping) == (1, 0.5)
        assert basis.by_quantity(basis.prior).keys() <= prior.keys()
        for quantity, deviations in basis.by_quantity(basis.prior).items():
            np.testing.assert_array_equal(deviations, prior[quantity])
    assert sizes == sorted(set(sizes))
