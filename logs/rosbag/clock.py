"""When each message was measured: by its own stamp, or else by when it was received."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.logs.rosbag.series import Column, IntArray, Series

APART = 60.0
"""Seconds: stamps further than that from the log times are of another clock."""

BEYOND = 1e12
"""No measurement of a robot is larger than this, in any unit; and its square is still finite."""


@dataclass(frozen=True, eq=False)
class Clocked:
    """The times of a topic's messages.

    Attributes:
        times: ``(n,)`` ns.
        usable: ``(n,)``: False for a single stamp that is far from all others.
        fallbacks: For how many messages the log time stands in for a stamp.
        latency: ``(k,)`` s, from stamp to log, of the messages that have a usable stamp.
    """

    times: IntArray
    usable: BoolArray
    fallbacks: int
    latency: FloatArray


class ClocksApartError(ValueError):
    """The stamps of a topic and its log times are of different clocks."""


@dataclass(frozen=True, eq=False)
class Track:
    """What is known of one thing over time.

    Attributes:
        times: ``(m,)`` ns, strictly increasing.
        values: ``(m, width)``, finite.
    """

    times: IntArray
    values: FloatArray


def clocked(series: Series, clock: str) -> Clocked:
    """Returns the times of a topic's messages.

    Args:
        series: The messages.
        clock: ``header``: by stamps, where there are any; ``log``: by log times alone.

    Raises:
        ClocksApartError: Stamps and log times differ by more than ``APART``.
    """
    stamped = series.stamps > 0
    latency = (series.logged - series.stamps)[stamped] / 1e9
    everything = np.ones(len(stamped), dtype=bool)
    apart = float(np.median(latency)) if len(latency) else 0.0
    if clock == "log":
        told = latency if abs(apart) <= APART else latency[:0]
        return Clocked(series.logged, everything, 0, told)
    if abs(apart) > APART:
        raise ClocksApartError(
            f"the stamps on {series.topic.name} and the times at which it was recorded are "
            f"{abs(apart):.0f} s apart (median), so they are of different clocks"
        )
    usable = everything.copy()
    usable[stamped] = np.abs(latency) <= APART
    return Clocked(
        times=np.where(stamped, series.stamps, series.logged),
        usable=usable,
        fallbacks=int(np.sum(~stamped)),
        latency=latency[np.abs(latency) <= APART],
    )


def track(clock: Clocked, column: Column, wanted: slice) -> Track:
    """Returns some of a column's numbers over time: sorted, each time once, all of them known.

    What is NaN, infinite or ``BEYOND`` is not known.

    Args:
        clock: The times of the topic.
        column: What the topic says.
        wanted: Which of the numbers.
    """
    times, values = clock.times[column.index], column.values[:, wanted]
    known = clock.usable[column.index] & (np.abs(values) <= BEYOND).all(axis=1)
    # unique() keeps the first of equal times, in the order of the recording.
    times, first = np.unique(times[known], return_index=True)
    return Track(times, values[known][first])
