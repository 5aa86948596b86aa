"""How well a topic was recorded: rate, jitter, gaps, latency, and what was left out."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from selfmodel.logs.rosbag.clock import Clocked
from selfmodel.logs.rosbag.resample import REACH
from selfmodel.logs.rosbag.series import Series

LISTED = 100
"""So many gaps of a topic are recorded one by one."""


@dataclass(frozen=True)
class Gap:
    """A time in which a topic was silent for more than ``REACH`` of its usual periods.

    Attributes:
        start: Seconds from the start of the trial to the last message before; may be negative.
        length: Seconds until the next message.
    """

    start: float
    length: float


@dataclass(frozen=True)
class Quality:
    """What is to be known of a topic's recording.

    Attributes:
        roles: Which roles it plays.
        type: The type of its messages.
        messages: How many it has.
        rate: Messages a second, from the usual (median) period; None for fewer than two.
        jitter: Standard deviation of the period without the gaps, s; None for fewer than two.
        longest: The longest period, s; None for fewer than two.
        gaps: In order.
        latency: Median of log time minus stamp, s; None where there are no stamps.
        latency_max: The largest, s.
        fallbacks: Messages that go by log time because they have no stamp.
        strays: Messages left out because their stamp is far from all others.
        repeated: Messages left out because another has the same stamp.
        reordered: Messages that came after one with a later stamp; they are put in their place.
        refused: Messages left out because they contradict themselves, by the reason.
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
        """Returns all that as plain values, with the first ``LISTED`` gaps."""
        longest = max((gap.length for gap in self.gaps), default=0.0)
        where = [[gap.start, gap.length] for gap in self.gaps[:LISTED]]
        gaps = {"count": len(self.gaps), "longest": longest, "where": where}
        return asdict(self) | {"gaps": gaps}


def quality(series: Series, clock: Clocked, origin: int, roles: tuple[str, ...]) -> Quality:
    """Returns the quality of a topic.

    Args:
        series: Its messages.
        clock: Their times.
        origin: When the trial starts, ns.
        roles: Which roles it plays.
    """
    told = clock.times[clock.usable]
    times = np.unique(told)
    periods = np.diff(times) / 1e9
    usual = float(np.median(periods)) if len(periods) else None
    silent = periods > REACH * usual if usual is not None else np.zeros(0, dtype=bool)
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
        repeated=len(told) - len(times),
        reordered=int(np.sum(told < np.maximum.accumulate(told))) if len(told) else 0,
        refused=dict(series.refused),
    )
