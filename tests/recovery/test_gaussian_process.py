"""The Gaussian process against that of scikit-learn."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

from selfmodel.recovery.gaussian_process import Kernel, posterior


def test_the_posterior_is_that_of_another_implementation():
    rng = np.random.default_rng(0)
    points, values, queries = rng.random((9, 4)), rng.standard_normal(9), rng.random((30, 4))
    mean, deviation = posterior(Kernel(0.4, 0.001), points, values, queries)
    other = GaussianProcessRegressor(Matern(0.4, nu=2.5), alpha=0.001, optimizer=None)
    expected = other.fit(points, values).predict(queries, return_std=True)

    assert mean == pytest.approx(expected[0], abs=1e-9)
    assert deviation == pytest.approx(expected[1], abs=1e-7)


def test_without_observations_the_prior_is_returned():
    mean, deviation = posterior(
        Kernel(0.4, 0.001), np.empty((0, 4)), np.empty(0), np.random.default_rng(0).random((3, 4))
    )

    assert mean.tolist() == [0, 0, 0]
    assert deviation.tolist() == [1, 1, 1]
