"""Losses of predictions of joints, and the test that compares them."""

import numpy as np

from selfmodel.arrays import FloatArray

MIN_Z = 3.0
"""Standard errors by which a larger set must predict segments better that it was not fitted to."""


def is_better(one: FloatArray, other: FloatArray) -> bool:
    """Returns whether the losses of segments are significantly lower, paired over the segments."""
    gains = other - one
    error = float(gains.std(ddof=1)) / np.sqrt(len(gains))
    return bool(gains.mean() > MIN_Z * error and gains.mean() > 0)


def root_mean_square(errors: FloatArray) -> float:
    """Returns the root mean square of errors."""
    return float(np.sqrt(np.mean(errors**2)))


def damped(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))
