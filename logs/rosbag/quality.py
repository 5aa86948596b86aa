"""Quality of a topic's recording: rate, jitter, gaps, latency, and dropped messages."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from selfmodel.logs.rosbag.clock import Clocked
from selfmodel.logs.rosbag.resample import MAX_PERIOD_RATIO
from selfmodel.logs.rosbag.series import Series

MAX_LISTED_GAPS = 100
"""Largest number of gaps of a topic in the metadata of a log."""


@dataclass(frozen=True)
class Gap:
    """A period between messages of more than ``MAX_PERIOD_RATIO`` median periods.

    Attributes:
        start: Time of the last message before the gap, s from the start of the trial; may be
            negative.
        length: Time until the next message, s.
    """

    start: float
    length: float


@dataclass(frozen=True)
class Quality:
    """Quality of a topic's recording.

    Attributes:
        roles: Names of the topic's roles.
        type: Message type.
        messages: Number of messages.
        rate: Reciprocal of the median period, Hz; None for fewer than two messages.
        jitter: Standard deviation of the period without gaps, s; None for fewer than two messages.
        longest: Longest period, s; None for fewer than two messages.
        gaps: Gaps, in order.
        latency: Median of log time minus stamp, s; None without stamps.
        latency_max: Maximum of log time minus stamp, s; None without stamps.
        fallbacks: Number of messages without a stamp, whose log time is used.
        strays: Number of messages dropped because their stamp is far from their log time.
        repeated: Number of messages dropped because their stamp is repeated.
        reordered: Number of messages after one with a later stamp, which are sorted.
        refused: Number of messages dropped as inconsistent, by reason.
    """

    roles: tuple[str, ...]
    type: str
    messages: int
    rate: float | None
    jitter: float | None
    longest: float | None
    gaps: tuple[Gap, ...]
    latency: float | None
    latency_max: float | None
    fallbacks: int
    strays: int
    repeated: int
    reordered: int
    refused: Mapping[str, int]

    def facts(self) -> dict[str, Any]:
        """Returns the quality as plain values, with the first ``MAX_LISTED_GAPS`` gaps."""
        longest = max((gap.length for gap in self.gaps), default=0.0)
        where = [[gap.start, gap.length] for gap in self.gaps[:MAX_LISTED_GAPS]]
        gaps = {"count": len(self.gaps), "longest": longest, "where": where}
        return asdict(self) | {"gaps": gaps}


def quality(series: Series, clock: Clocked, origin: int, roles: tuple[str, ...]) -> Quality:
    """Returns the quality of a topic.

    Args:
        series: Messages of the topic.
        clock: Times of the messages.
        origin: Start of the trial, ns since 1970.
        roles: Names of the topic's roles.
    """
    recorded = clock.times[clock.usable]
    times = np.unique(recorded)
    periods = np.diff(times) / 1e9
    median = float(np.median(periods)) if len(periods) else None
    is_gap = periods > MAX_PERIOD_RATIO * median if median is not None else np.zeros(0, dtype=bool)
    return Quality(
        roles=roles,
        type=series.topic.type,
        messages=series.topic.count,
        rate=None if median is None else 1 / median,
        jitter=float(np.std(periods[~is_gap])) if len(periods) else None,
        longest=float(periods.max()) if len(periods) else None,
        gaps=tuple(
            Gap(float(times[k] - origin) / 1e9, float(periods[k])) for k in np.flatnonzero(is_gap)
        ),
        latency=float(np.median(clock.latency)) if len(clock.latency) else None,
        latency_max=float(clock.latency.max()) if len(clock.latency) else None,
        fallbacks=clock.fallbacks,
        strays=int(np.sum(~clock.usable)),
        repeated=len(recorded) - len(times),
        reordered=int(np.sum(recorded < np.maximum.accumulate(recorded))) if len(recorded) else 0,
        refused=dict(series.refused),
    )
