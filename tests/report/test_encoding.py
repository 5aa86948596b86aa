import numpy as np

from selfmodel.report.encoding import quantised
from tests.report.decoding import decoded


def test_quantised_numbers_are_within_half_a_level_of_the_numbers():
    values = np.random.default_rng(0).normal(size=(50, 3)) * [1e-3, 1.0, 1e3]

    error = np.abs(decoded(quantised(values)) - values)

    assert np.all(error <= np.ptp(values, axis=0) / 131070 * (1 + 1e-9))


def test_a_column_of_one_number_is_exact():
    assert np.array_equal(decoded(quantised(np.full((3, 1), 0.1))), np.full((3, 1), 0.1))
