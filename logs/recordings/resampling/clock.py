"""Measurement time of each message: its time stamp, or else its log time."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.logs.recordings.series import Column, IntArray, Series

MAX_LATENCY = 60.0
"""Maximum median difference of stamps and log times of one clock, s."""

MAX_MEASUREMENT = 1e12
"""Magnitude above which a value is no measurement, in any unit; its square is finite."""


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


class ClocksApartError(ValueError):
    """The stamps of a topic and its log times are of different clocks."""


@dataclass(frozen=True, eq=False)
class Track:
    """Time series of one quantity.

    Attributes:
        times: Times, ``(m,)`` ns, strictly increasing.
        values: Values, ``(m, width)``, finite.
    """

    times: IntArray
    values: FloatArray


def clocked(series: Series, clock: str) -> Clocked:
    """Returns the times of a topic's messages.

    Args:
        series: Messages of the topic.
        clock: ``header`` for stamps, with log times for messages without a stamp; ``log`` for log
            times.

    Raises:
        ClocksApartError: Stamps and log times differ by more than ``MAX_LATENCY``.
    """
    stamped = series.stamps > 0
    latency = (series.logged - series.stamps)[stamped] / 1e9
    everything = np.ones(len(stamped), dtype=bool)
    apart = float(np.median(latency)) if len(latency) else 0.0
    if clock == "log":
        usable_latency = latency if abs(apart) <= MAX_LATENCY else latency[:0]
        return Clocked(series.logged, everything, 0, usable_latency)
    if abs(apart) > MAX_LATENCY:
        raise ClocksApartError(
            f"the stamps on {series.topic.name} and the times at which it was recorded are "
            f"{abs(apart):.0f} s apart (median), so they are of different clocks"
        )
    usable = everything.copy()
    usable[stamped] = np.abs(latency) <= MAX_LATENCY
    return Clocked(
        times=np.where(stamped, series.stamps, series.logged),
        usable=usable,
        fallbacks=int(np.sum(~stamped)),
        latency=latency[np.abs(latency) <= MAX_LATENCY],
    )


def track(clock: Clocked, column: Column, wanted: slice) -> Track:
    """Returns the time series of some of a column's numbers, sorted, with distinct times.

    Rows with a value that is NaN, infinite or above ``MAX_MEASUREMENT`` are left out.

    Args:
        clock: Times of the topic.
        column: Column of the topic.
        wanted: Slice of the numbers.
    """
    times, values = clock.times[column.index], column.values[:, wanted]
    known = clock.usable[column.index] & (np.abs(values) <= MAX_MEASUREMENT).all(axis=1)
    # unique() keeps the first of equal times, in the order of the recording.
    times, first = np.unique(times[known], return_index=True)
    return Track(times, values[known][first])
