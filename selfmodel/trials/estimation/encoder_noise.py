"""Noise level of joint encoders, and the motion that counts as none, from a log alone."""

import math

import numpy as np

from selfmodel.arrays import FloatArray

PLAY = 0.01
"""Motion of a jammed joint by elasticity and backlash, rad."""

NOISE_FACTOR = 2.0
"""Factor on an encoder's noise in the tolerance: noise alone must be a small part of it."""

_ORDER = 4
"""Order of the differences between neighbouring steps: it suppresses motion, and not noise."""

_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable


def standing_tolerance(positions: FloatArray) -> FloatArray:
    """Returns the root mean square motion up to which a hinge counts as standing, ``(hinges,)``.

    Args:
        positions: Logged joint positions, ``(steps, hinges)`` rad; NaN where unknown.
    """
    return np.hypot(PLAY, NOISE_FACTOR * encoder_noise(positions))


def encoder_noise(positions: FloatArray) -> FloatArray:
    """Returns the standard deviation of the noise of each encoder, ``(hinges,)``.

    The larger of two estimates: white noise with the same median fourth difference, and the
    rounding error of an encoder with steps as large as the smallest difference between two of its
    values. The first alone is 0 for a hinge that stands between two steps of its encoder.

    Args:
        positions: Logged joint positions, ``(steps, hinges)`` rad; NaN where unknown.

    Returns:
        Noise levels, rad; 0 for a column of too few values, or of one value.
    """
    return np.array([_noise(column) for column in positions.T], dtype=np.float64)


def _noise(column: FloatArray) -> float:
    differences = np.abs(np.diff(column, _ORDER))
    known = differences[np.isfinite(differences)]
    white = float(np.median(known)) / _NORMAL_MEDIAN if len(known) else 0.0
    steps = np.diff(np.unique(column[np.isfinite(column)]))
    rounding = float(steps.min()) / math.sqrt(12) if len(steps) else 0.0
    return max(white / math.sqrt(math.comb(2 * _ORDER, _ORDER)), rounding)
