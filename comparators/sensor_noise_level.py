"""Loss on the noise level of single sensors, estimated from fourth differences.

It serves the fault kind ``sensor-noise`` only: noise has no predictable values, but a level.
"""

import math

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray

ORDER = 4
"""Order of the differences between neighbouring readings: high enough to suppress even fast motion,
and not noise."""

RATIO, MARGIN = 2.0, 0.06
"""A sensor's noise level counts if it exceeds RATIO times the median of the other sensors' plus
MARGIN, in a reading's unit. All sensors have measurement noise; an excess of one is a fault."""

ERROR_SCALE = 0.05
"""Error of a predicted noise level that counts as large, in a reading's unit."""


def noise_level_loss(predicted: FloatArray, logged: FloatArray, graded: BoolArray) -> FloatArray:
    """Returns the loss of the predicted noise levels of the sensors, ``(n,)``.

    Per reading, a hypothesis with noise predicts worse than one without, because its noise values
    differ from those of the log. Noise levels are comparable.

    Args:
        predicted: Predicted readings, ``(n, segments, rows, sensors)``.
        logged: Logged readings, ``(segments, rows, sensors)``; NaN if unknown.
        graded: Mask of the sensors with readings other than 0 and 1, per hypothesis,
            ``(n, sensors)``.

    Returns:
        The mean over the sensors of ``log(1 + (e / ERROR_SCALE)^2)``, with e the error of the noise
        level in a reading's unit; exactly 0 if no sensor has an excess of noise in the log or in
        the prediction, if segments have no more than ``ORDER`` rows, and without sensors.
    """
    _, rows, sensors = logged.shape
    if rows <= ORDER or not sensors:
        return np.zeros(len(predicted))
    found = _excess(logged[np.newaxis], graded)
    error = (_excess(predicted, graded) - found) / ERROR_SCALE
    return np.asarray(np.log1p(np.square(error)).mean(axis=1))


def _excess(readings: FloatArray, graded: BoolArray) -> FloatArray:
    """Returns the standard deviation of each sensor's noise beyond the usual noise."""
    noise = np.where(graded, _noise_level(readings), np.nan)
    usual = _median_of_others(noise)
    beyond = noise > RATIO * usual + MARGIN
    return np.sqrt(np.where(beyond, np.square(noise) - np.square(usual), 0.0))


def _noise_level(readings: FloatArray) -> FloatArray:
    """Returns the standard deviation of white noise with the same differences, ``(n, sensors)``.

    The median of the differences is robust against impacts.
    """
    steps = np.abs(np.diff(readings, ORDER, axis=2))
    n, _, _, sensors = steps.shape
    by_sensor = steps.transpose(0, 3, 1, 2).reshape(n, sensors, -1)
    return _median(by_sensor) / (_NORMAL_MEDIAN * math.sqrt(math.comb(2 * ORDER, ORDER)))


_NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable


def _median(values: FloatArray) -> FloatArray:
    """Returns the median over the last axis of the finite values; NaN if there are none."""
    ordered = np.sort(values, axis=-1)  # NaN comes last
    known = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    middle = np.take_along_axis(ordered, np.maximum(known - 1, 0) // 2, axis=-1)
    return np.asarray(middle[..., 0])


def _median_of_others(noise: FloatArray) -> FloatArray:
    """Returns for each column the median of the other columns; NaN if there are no others."""
    sensors = noise.shape[1]
    others = np.where(np.eye(sensors, dtype=bool), np.nan, noise[:, np.newaxis, :])
    return _median(others)
