"""Losses of predictions, and the test that compares them."""

import numpy as np

from selfmodel.arrays import FloatArray


def is_better(one: FloatArray, other: FloatArray, min_z: float) -> bool:
    """Returns whether the losses of segments are significantly lower, paired over the segments.

    Args:
        one: Losses of the segments, ``(segments,)``.
        other: Losses of the same segments, to be undercut.
        min_z: Smallest mean difference, in standard errors.
    """
    gains = other - one
    error = float(gains.std(ddof=1)) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return bool(gains.mean() > min_z * error and gains.mean() > 0)


def root_mean_square(errors: FloatArray) -> float:
    """Returns the root mean square of errors."""
    return float(np.sqrt(np.mean(errors**2)))


def damped(errors: FloatArray) -> FloatArray:
    """Returns pseudo-Huber residuals: their squares grow linearly with errors above 1."""
    return np.asarray(np.sign(errors) * np.sqrt(2 * (np.sqrt(1 + errors**2) - 1)))
