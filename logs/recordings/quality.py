"""Recording quality of a topic: rate, jitter, gaps, latency, and omitted messages."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from selfmodel.logs.recordings.resampling.clock import Clocked
from selfmodel.logs.recordings.resampling.resample import MAX_PERIOD_RATIO
from selfmodel.logs.recordings.series import Series

MAX_LISTED_GAPS = 100
"""Maximum listed gaps of a topic."""


@dataclass(frozen=True)
class Gap:
    """Interval between two messages longer than ``MAX_PERIOD_RATIO`` usual periods.

    Attributes:
        start: Time of the message before the gap, from the start of the trial, s; may be negative.
        length: Duration, s.
    """

    start: float
    length: float


@dataclass(frozen=True)
class Quality:
    """Recording quality of a topic.

    Attributes:
        roles: Roles of the topic.
        type: Message type.
        messages: Number of messages.
        rate: Message rate from the median period, 1/s; None for fewer than two messages.
        jitter: Standard deviation of the period without gaps, s; None for fewer than two messages.
        longest: Longest period, s; None for fewer than two messages.
        gaps: Gaps, in order.
        latency: Median of log time minus stamp, s; None without stamps.
        latency_max: Maximum of log time minus stamp, s; None without stamps.
        fallbacks: Number of messages without a stamp, which have their log time.
        strays: Number of messages left out because their stamp is far from all others.
        repeated: Number of messages left out because of a repeated stamp.
        reordered: Number of messages recorded after a later stamp, and sorted.
        refused: Numbers of messages left out because they contradict themselves, by reason.
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
        """Returns the quality as JSON values, with the first ``MAX_LISTED_GAPS`` gaps."""
        longest = max((gap.length for gap in self.gaps), default=0.0)
        where = [[gap.start, gap.length] for gap in self.gaps[:MAX_LISTED_GAPS]]
        gaps = {"count": len(self.gaps), "longest": longest, "where": where}
        return asdict(self) | {"gaps": gaps}


def quality(series: Series, clock: Clocked, origin: int, roles: tuple[str, ...]) -> Quality:
    """Returns the quality of a topic.

    Args:
        series: Messages of the topic.
        clock: Times of the messages.
        origin: Start of the trial, ns.
        roles: Roles of the topic.
    """
    usable = clock.times[clock.usable]
    times = np.unique(usable)
    periods = np.diff(times) / 1e9
    usual = float(np.median(periods)) if len(periods) else None
    silent = periods > MAX_PERIOD_RATIO * usual if usual is not None else np.zeros(0, dtype=bool)
    return Quality(
        roles=roles,
        type=series.topic.type,
        messages=series.topic.count,
        rate=None if usual is None else 1 / usual,
        jitter=float(np.std(periods[~silent])) if len(periods) else None,
        longest=float(periods.max()) if len(periods) else None,
        gaps=tuple(
            Gap(float(times[k] - origin) / 1e9, float(periods[k])) for k in np.flatnonzero(silent)
        ),
        latency=float(np.median(clock.latency)) if len(clock.latency) else None,
        latency_max=float(clock.latency.max()) if len(clock.latency) else None,
        fallbacks=clock.fallbacks,
        strays=int(np.sum(~clock.usable)),
        repeated=len(usable) - len(times),
        reordered=int(np.sum(usable < np.maximum.accumulate(usable))) if len(usable) else 0,
        refused=dict(series.refused),
    )
