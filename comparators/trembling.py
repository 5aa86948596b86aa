"""How much a sensor trembles beside the others: noise that is where no prediction can be."""

import math

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray

ORDER = 4
"""Of the differences between neighbouring readings: high, so that of a motion hardly anything is
left, not of a fast one either, and noise is."""

TIMES, LEAST = 2.0, 0.06
"""How many times as much as the others, and how much more, a sensor has to tremble until it counts.
All instruments have noise; what a single one has is a fault."""

SCALE = 0.05
"""By how much a prediction of noise may be wrong until the error counts as large."""


def trembling_loss(predicted: FloatArray, logged: FloatArray, graded: BoolArray) -> FloatArray:
    """Returns how badly the noise of single sensors is predicted, ``(n,)``.

    Reading by reading, a hypothesis that says noise predicts worse than one that says none: its
    noise is not that of the log. What can be compared is how much there is of it.

    Args:
        predicted: Readings, ``(n, segments, rows, sensors)``.
        logged: What was received, ``(segments, rows, sensors)``; NaN where it is not known.
        graded: For each hypothesis the sensors that read more than yes or no, ``(n, sensors)``.

    Returns:
        The mean over the sensors of ``log(1 + (e / SCALE)^2)``, e in a reading's unit; exactly 0
        where no sensor trembles more than the others, in the log or in the prediction, and where
        segments have no more than ``ORDER`` rows.
    """
    if logged.shape[1] <= ORDER:
        return np.zeros(len(predicted))
    found = _excess(logged[np.newaxis], graded)
    error = (_excess(predicted, graded) - found) / SCALE
    return np.asarray(np.log1p(np.square(error)).mean(axis=1))


def _excess(readings: FloatArray, graded: BoolArray) -> FloatArray:
    """The standard deviation of the noise that a sensor has and the others do not."""
    noise = np.where(graded, _noise(readings), np.nan)
    usual = _median_of_others(noise)
    beyond = noise > TIMES * usual + LEAST
    return np.sqrt(np.where(beyond, np.square(noise) - np.square(usual), 0.0))


def _noise(readings: FloatArray) -> FloatArray:
    """The standard deviation of white noise that trembles as much, ``(n, sensors)``.

    The median of the differences forgives impacts.
    """
    steps = np.abs(np.diff(readings, ORDER, axis=2))
    n, _, _, sensors = steps.shape
    of_one = steps.transpose(0, 3, 1, 2).reshape(n, sensors, -1)
    return _median(of_one) / (_NORMAL_MEDIAN * math.sqrt(math.comb(2 * ORDER, ORDER)))


_NORMAL_MEDIAN = 0.6745  # of the size of a number drawn from the standard normal distribution


def _median(values: FloatArray) -> FloatArray:
    """Over the last axis, of what is known; NaN where nothing is."""
    ordered = np.sort(values, axis=-1)  # NaN comes last
    known = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    middle = np.take_along_axis(ordered, np.maximum(known - 1, 0) // 2, axis=-1)
    return np.asarray(middle[..., 0])


def _median_of_others(noise: FloatArray) -> FloatArray:
    """For each column the median of the other columns; NaN where there is no other."""
    sensors = noise.shape[1]
    others = np.where(np.eye(sensors, dtype=bool), np.nan, noise[:, np.newaxis, :])
    return _median(others)
