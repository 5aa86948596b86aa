"""Resampling of irregular samples at the control steps, with NaN in gaps.

All times of a call are in the same unit.
"""

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray

MAX_PERIOD_RATIO = 1.5
"""Minimum gap between two samples, in usual (median) periods."""


def reach(times: FloatArray) -> float:
    """Returns the maximum distance of two samples between which a series is interpolated.

    Args:
        times: Times of the samples, ``(m,)``, increasing.
    """
    return MAX_PERIOD_RATIO * float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def linear(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns linearly interpolated values.

    Args:
        times: Times of the samples, ``(m,)``, strictly increasing.
        values: Samples, ``(m, width)``.
        at: Times of the steps, ``(steps,)``.
        limit: See ``reach``.

    Returns:
        Values, ``(steps, width)``; exactly the sample at the time of a sample.
    """
    before, after, share, valid = _bracket(times, at, limit)
    result = np.full((len(at), values.shape[1]), np.nan)
    low, high = values[before[valid]], values[after[valid]]
    part = share[valid, np.newaxis]
    result[valid] = np.where(part == 0, low, low + part * (high - low))  # -0 + 0 is 0
    return result


def angles(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns angles interpolated along the shorter arc; see ``linear``.

    Args:
        times: Times of the samples, ``(m,)``, strictly increasing.
        values: Angles, ``(m, width)`` rad; a jump by more than pi is a wrap-around.
        at: Times of the steps, ``(steps,)``.
        limit: See ``reach``.
    """
    return linear(times, np.unwrap(values, axis=0), at, limit)


def slerp(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns orientations interpolated along the shortest arc.

    Args:
        times: Times of the samples, ``(m,)``, strictly increasing.
        values: Unit quaternions of either sign, ``(m, 4)``.
        at: Times of the steps, ``(steps,)``.
        limit: See ``reach``.

    Returns:
        Unit quaternions, ``(steps, 4)``; the sample to rounding at the time of a sample.
    """
    before, after, share, valid = _bracket(times, at, limit)
    result = np.full((len(at), 4), np.nan)
    low, high = values[before[valid]], values[after[valid]]
    cosine = np.sum(low * high, axis=1, keepdims=True)
    high = np.where(cosine < 0, -high, high)
    # The angle from both chords: exact for small angles, where that of a cosine is not.
    half = np.arctan2(
        np.linalg.norm(high - low, axis=1, keepdims=True),
        np.linalg.norm(high + low, axis=1, keepdims=True),
    )
    part = share[valid, np.newaxis]
    # sin(x)/sin(a) as sinc, which has its limit at 0.
    sine = np.sinc(2 * half / np.pi)
    turned = (
        (1 - part) * np.sinc((1 - part) * 2 * half / np.pi) * low
        + part * np.sinc(part * 2 * half / np.pi) * high
    ) / sine
    result[valid] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return result


def slerp_or_sample(
    times: FloatArray, values: FloatArray, at: FloatArray, limit: float
) -> FloatArray:
    """Returns orientations as ``slerp``, with the bits of the sample at the time of a sample."""
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)
    exact = times[before] == at
    return np.where(exact[:, np.newaxis], values[before], slerp(times, values, at, limit))


def hold(
    times: FloatArray, values: FloatArray, at: FloatArray, limit: float = np.inf
) -> FloatArray:
    """Returns the last sample before each step (zero-order hold).

    Args:
        times: Times of the samples, ``(m,)``, strictly increasing.
        values: Samples, ``(m, width)``.
        at: Times of the steps, ``(steps,)``.
        limit: Maximum age of a sample; infinite for commands.

    Returns:
        Values, ``(steps, width)``.
    """
    before = np.searchsorted(times, at, side="right") - 1
    result = np.full((len(at), values.shape[1]), np.nan)
    held = before >= 0
    held[held] = at[held] - times[before[held]] <= limit
    result[held] = values[before[held]]
    return result


def _bracket(
    times: FloatArray, at: FloatArray, limit: float
) -> tuple[IndexArray, IndexArray, FloatArray, BoolArray]:
    """Samples before and after each time, the fraction between them, and its validity."""
    if not len(times):
        nowhere = np.zeros(len(at), dtype=np.intp)
        return nowhere, nowhere, np.zeros(len(at)), np.zeros(len(at), dtype=bool)
    last = len(times) - 1
    before = np.searchsorted(times, at, side="right") - 1
    inside = before >= 0
    before = np.clip(before, 0, last)
    after = np.minimum(before + 1, last)
    period = times[after] - times[before]
    exact = inside & (times[before] == at)
    valid = exact | (inside & (after > before) & (period <= limit))
    share = np.zeros(len(at))
    between = valid & ~exact
    share[between] = (at[between] - times[before[between]]) / period[between]
    return before, after, share, valid
