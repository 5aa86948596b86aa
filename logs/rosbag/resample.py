"""Interpolation of irregular samples at the control steps.

All times are in the same unit. Results are NaN outside the samples and in gaps between them.
"""

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray

MAX_PERIOD_RATIO = 1.5
"""Largest period between two samples without a gap, in median periods."""


def reach(times: FloatArray) -> float:
    """Returns the largest period between two samples across which values are interpolated.

    Args:
        times: Sample times, ``(m,)``, increasing.
    """
    return MAX_PERIOD_RATIO * float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def linear(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns linearly interpolated values.

    Args:
        times: Sample times, ``(m,)``, strictly increasing.
        values: Sample values, ``(m, width)``.
        at: Times of the control steps, ``(steps,)``.
        limit: Largest period across which values are interpolated; see ``reach``.

    Returns:
        ``(steps, width)``; the exact sample at the time of a sample.
    """
    before, after, share, valid = _bracket(times, at, limit)
    result = np.full((len(at), values.shape[1]), np.nan)
    low, high = values[before[valid]], values[after[valid]]
    result[valid] = low + share[valid, np.newaxis] * (high - low)
    return result


def angles(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns linearly interpolated angles, across wrap-arounds; see ``linear``.

    Args:
        times: Sample times, ``(m,)``, strictly increasing.
        values: Sample values, ``(m, width)`` rad; a jump by more than pi is a wrap-around.
        at: Times of the control steps, ``(steps,)``.
        limit: Largest period across which values are interpolated; see ``reach``.
    """
    return linear(times, np.unwrap(values, axis=0), at, limit)


def slerp(times: FloatArray, values: FloatArray, at: FloatArray, limit: float) -> FloatArray:
    """Returns spherically interpolated orientations, along the shortest arc.

    Args:
        times: Sample times, ``(m,)``, strictly increasing.
        values: Unit quaternions, ``(m, 4)``; a quaternion and its negative are equivalent.
        at: Times of the control steps, ``(steps,)``.
        limit: Largest period across which values are interpolated; see ``reach``.

    Returns:
        Unit quaternions, ``(steps, 4)``.
    """
    before, after, share, valid = _bracket(times, at, limit)
    result = np.full((len(at), 4), np.nan)
    low, high = values[before[valid]], values[after[valid]]
    cosine = np.sum(low * high, axis=1, keepdims=True)
    high = np.where(cosine < 0, -high, high)
    # Half the angle from both chords: accurate for small angles, unlike the arc cosine.
    half = np.arctan2(
        np.linalg.norm(high - low, axis=1, keepdims=True),
        np.linalg.norm(high + low, axis=1, keepdims=True),
    )
    fraction = share[valid, np.newaxis]
    # sin(x)/sin(a) by sinc, which is finite at a = 0.
    sine = np.sinc(2 * half / np.pi)
    interpolated = (
        (1 - fraction) * np.sinc((1 - fraction) * 2 * half / np.pi) * low
        + fraction * np.sinc(fraction * 2 * half / np.pi) * high
    ) / sine
    result[valid] = interpolated / np.linalg.norm(interpolated, axis=1, keepdims=True)
    return result


def hold(
    times: FloatArray, values: FloatArray, at: FloatArray, limit: float = np.inf
) -> FloatArray:
    """Returns the last sample before each time (zero-order hold).

    Args:
        times: Sample times, ``(m,)``, strictly increasing.
        values: Sample values, ``(m, width)``.
        at: Times of the control steps, ``(steps,)``.
        limit: Largest age of a sample; infinite for commands, finite for measurements.

    Returns:
        ``(steps, width)``.
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
    """Returns the samples before and after each time, the fraction between them, and validity."""
    if not len(times):
        indices = np.zeros(len(at), dtype=np.intp)
        return indices, indices, np.zeros(len(at)), np.zeros(len(at), dtype=bool)
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
