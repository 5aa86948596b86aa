"""Series of a recording on one clock, resampled at the control steps, with NaN in gaps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.logs.recordings.recording import Column, IntArray, Series

MAX_LATENCY = 60.0
"""Maximum median difference of stamps and log times of one clock, s."""

MAX_MEASUREMENT = 1e12
"""Magnitude above which a value is no measurement, in any unit; its square is finite."""

MAX_PERIOD_RATIO = 1.5
"""Minimum gap between two samples, in usual periods; see ``reach``."""

RATE_WINDOW = 25
"""Number of periods whose median is the usual period around one of them: rates may change."""


@dataclass(frozen=True, eq=False)
class Clocked:
    """Times of a topic's messages.

    Attributes:
        times: Times, ``(n,)`` ns.
        usable: Flags, ``(n,)``; False for a stamp far from all other stamps.
        fallbacks: Number of messages without a stamp, which have their log time.
        latency: Delay from stamp to log time, ``(k,)`` s, of the messages with a usable stamp.
    """

    times: IntArray
    usable: BoolArray
    fallbacks: int
    latency: FloatArray


@dataclass(frozen=True, eq=False)
class Track:
    """Finite values of a quantity, ``(m, width)``, at increasing times, ``(m,)`` ns; or none."""

    times: IntArray
    values: FloatArray

    def __len__(self) -> int:
        return len(self.times)

    def scaled(self, scale: float, offset: float = 0.0) -> "Track":
        """Returns the track in another unit."""
        if scale == 1 and offset == 0:
            return self  # 0 would change the sign of a zero
        return Track(self.times, self.values * scale + offset)

    def joined(self, later: "Track") -> "Track":
        """Returns the track with values that were recorded later, but may have earlier times."""
        if not (len(self) and len(later)):
            return self if len(self) else later
        times = np.concatenate([self.times, later.times])
        times, first = np.unique(times, return_index=True)
        return Track(times, np.concatenate([self.values, later.values])[first])

    def since(self, time: int) -> "Track":
        """Returns the track from the last value before a time on, ns."""
        first = max(0, int(np.searchsorted(self.times, time)) - 1)
        return Track(self.times[first:], self.values[first:])


NOTHING = Track(np.zeros(0, dtype=np.int64), np.zeros((0, 1)))


def clocked(series: Series, clock: str) -> Clocked:
    """Returns the times of a topic's messages.

    The clock ``header`` is that of stamps, with log times for messages without a stamp; any other
    is that of log times.

    Raises:
        ValueError: The stamps of the topic and its log times are of different clocks.
    """
    stamped = series.stamps > 0
    latency = (series.logged - series.stamps)[stamped] / 1e9
    near = np.abs(latency) <= MAX_LATENCY
    apart = float(np.median(latency)) if len(latency) else 0.0
    usable = np.ones(len(stamped), dtype=bool)
    if clock != "header":
        known = latency if abs(apart) <= MAX_LATENCY else latency[:0]
        return Clocked(series.logged, usable, 0, known)
    if abs(apart) > MAX_LATENCY:
        raise ValueError(
            f"the stamps and the times at which they were recorded are {abs(apart):.0f} s apart "
            f"(median), so they are of different clocks"
        )
    usable[stamped] = near
    times = np.where(stamped, series.stamps, series.logged)
    return Clocked(times, usable, int(np.sum(~stamped)), latency[near])


def track(clock: Clocked, columns: Sequence[Column], numbers: slice) -> Track:
    """Returns some numbers of columns of a topic, side by side, sorted, with distinct times.

    Rows with a value that is NaN, infinite or above ``MAX_MEASUREMENT`` are left out.
    """
    index = columns[0].index
    values = np.concatenate([column.values for column in columns], axis=1)[:, numbers]
    known = clock.usable[index] & (np.abs(values) <= MAX_MEASUREMENT).all(axis=1)
    # unique() keeps the first of equal times, in the order of the recording.
    times, first = np.unique(clock.times[index][known], return_index=True)
    return Track(times, values[known][first])


# ---------------------------------------------------------------- interpolation

Method = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]
"""Interpolation of samples at ``(m,)`` times, ``(m, width)``, at the times of the steps, within
limits (``reach``): ``(steps, width)``."""


@dataclass(frozen=True, eq=False)
class ControlSteps:
    """Control steps of a trial.

    Attributes:
        origin: Time of the first step of the trial, ns.
        timestep: Control time step, s.
        numbers: Numbers of the steps, from 0, ``(steps,)``.
    """

    origin: int
    timestep: float
    numbers: IntArray

    @property
    def seconds(self) -> FloatArray:
        """Times of the steps, ``(steps,)`` s."""
        return self.numbers.astype(np.float64) * self.timestep


def at_steps(track: Track, steps: ControlSteps, method: Method, width: int) -> FloatArray:
    """Returns a track at control steps, ``(steps, width)``; NaN where not observed."""
    if not len(track):
        return np.full((len(steps.numbers), width), np.nan)
    # float64 represents nanoseconds exactly for a hundred days.
    times = (track.times - steps.origin).astype(np.float64)
    period = steps.timestep * 1e9
    at = np.rint(steps.numbers * period)
    return method(times, track.values, at, reach(times, float(np.rint(period))))


def reach(times: FloatArray | IntArray, step: float = 0.0) -> FloatArray:
    """Returns the maximum distance after each sample over which a series is interpolated, ``(m,)``.

    It is ``MAX_PERIOD_RATIO`` usual periods, and at least a control step. The usual period is the
    longest of three medians: of all periods, and of those before and after the sample.
    """
    periods = np.diff(times).astype(np.float64)
    if not len(periods):
        return np.zeros(len(times))
    usual = np.full(len(periods), np.median(periods))
    if (last := len(periods) - RATE_WINDOW) >= 0:
        half = RATE_WINDOW // 2
        medians = median_filter(periods, RATE_WINDOW, mode="nearest")[half : len(periods) - half]
        place = np.arange(len(periods))
        for first in (np.minimum(place, last), np.maximum(place - RATE_WINDOW + 1, 0)):
            usual = np.maximum(usual, medians[first])
    limits = np.maximum(MAX_PERIOD_RATIO * usual, step)
    return np.append(limits, limits[-1])


def linear(times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray) -> FloatArray:
    """Returns linearly interpolated values; exactly the sample at the time of a sample."""
    before, after, share, valid = _bracket(times, at, limits)
    result = np.full((len(at), values.shape[1]), np.nan)
    low, high = values[before[valid]], values[after[valid]]
    part = share[valid, np.newaxis]
    result[valid] = np.where(part == 0, low, low + part * (high - low))  # -0 + 0 is 0
    return result


def angles(times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray) -> FloatArray:
    """Returns angles interpolated along the shorter arc; a jump above pi is a wrap-around."""
    return linear(times, np.unwrap(values, axis=0), at, limits)


def slerp(times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray) -> FloatArray:
    """Returns unit quaternions interpolated along the shortest arc, of either sign."""
    before, after, share, valid = _bracket(times, at, limits)
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
    times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray
) -> FloatArray:
    """Returns orientations as ``slerp``, with the bits of the sample at the time of a sample."""
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)
    exact = times[before] == at
    return np.where(exact[:, np.newaxis], values[before], slerp(times, values, at, limits))


def hold(times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray) -> FloatArray:
    """Returns the last sample before each step (zero-order hold), of an age up to its limit."""
    before = np.searchsorted(times, at, side="right") - 1
    result = np.full((len(at), values.shape[1]), np.nan)
    held = before >= 0
    held[held] = at[held] - times[before[held]] <= limits[before[held]]
    result[held] = values[before[held]]
    return result


def hold_forever(
    times: FloatArray, values: FloatArray, at: FloatArray, _limits: FloatArray
) -> FloatArray:
    """Returns the last sample before each step, of any age: a command stands until the next."""
    return hold(times, values, at, np.full(len(times), np.inf))


def hold_outside_gaps(
    times: FloatArray, values: FloatArray, at: FloatArray, limits: FloatArray
) -> FloatArray:
    """Returns the last sample before each step where ``linear`` has one."""
    unknown = np.isnan(linear(times, values, at, limits))
    return np.where(unknown, np.nan, hold_forever(times, values, at, limits))


def _bracket(
    times: FloatArray, at: FloatArray, limits: FloatArray
) -> tuple[IndexArray, IndexArray, FloatArray, BoolArray]:
    """Samples before and after each time, the fraction between them, and its validity."""
    last = len(times) - 1
    before = np.searchsorted(times, at, side="right") - 1
    inside = before >= 0
    before = np.clip(before, 0, last)
    after = np.minimum(before + 1, last)
    period = times[after] - times[before]
    exact = inside & (times[before] == at)
    valid = exact | (inside & (after > before) & (period <= limits[before]))
    share = np.zeros(len(at))
    between = valid & ~exact
    share[between] = (at[between] - times[before[between]]) / period[between]
    return before, after, share, valid
