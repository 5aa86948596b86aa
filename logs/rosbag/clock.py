"""Measurement times of messages: their header stamps, or else their log times."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.logs.rosbag.series import Column, IntArray, Series

MAX_LATENCY = 60.0
"""Largest difference between stamps and log times of the same clock, s."""

MAX_MEASUREMENT = 1e12
"""Largest valid measurement, in any unit; its square is finite."""


@dataclass(frozen=True, eq=False)
class Clocked:
    """The times of a topic's messages.

    Attributes:
        times: Measurement times, ``(n,)`` ns.
        usable: Whether the time is valid, ``(n,)``; False for stamps far from their log time.
        fallbacks: Number of messages without a stamp, whose log time is used.
        latency: Log time minus stamp of the messages with a valid stamp, ``(k,)`` s.
    """

    times: IntArray
    usable: BoolArray
    fallbacks: int
    latency: FloatArray


class ClocksApartError(ValueError):
    """The stamps and the log times of a topic are from different clocks."""


@dataclass(frozen=True, eq=False)
class Track:
    """Samples of one quantity over time.

    Attributes:
        times: Times, ``(m,)`` ns, strictly increasing.
        values: Values, ``(m, width)``, finite.
    """

    times: IntArray
    values: FloatArray


def clocked(series: Series, clock: str) -> Clocked:
    """Returns the times of a topic's messages.

    Args:
        series: The messages.
        clock: ``header`` for stamps, with log times for messages without one; ``log`` for log
            times only.

    Raises:
        ClocksApartError: Stamps and log times differ by more than ``MAX_LATENCY``.
    """
    stamped = series.stamps > 0
    latency = (series.logged - series.stamps)[stamped] / 1e9
    everything = np.ones(len(stamped), dtype=bool)
    difference = float(np.median(latency)) if len(latency) else 0.0
    if clock == "log":
        valid = latency if abs(difference) <= MAX_LATENCY else latency[:0]
        return Clocked(series.logged, everything, 0, valid)
    if abs(difference) > MAX_LATENCY:
        raise ClocksApartError(
            f"the stamps on {series.topic.name} and the times at which it was recorded are "
            f"{abs(difference):.0f} s apart (median), so they are of different clocks"
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
    """Returns the track of some numbers of a column: sorted, with unique times and valid values.

    Values that are not finite, or above ``MAX_MEASUREMENT``, are dropped.

    Args:
        clock: The times of the topic.
        column: The column of the topic.
        wanted: Columns of the numbers.
    """
    times, values = clock.times[column.index], column.values[:, wanted]
    valid = clock.usable[column.index] & (np.abs(values) <= MAX_MEASUREMENT).all(axis=1)
    # numpy.unique keeps the first of equal times, in the order of the recording.
    times, first = np.unique(times[valid], return_index=True)
    return Track(times, values[valid][first])
