"""Whether the steps of a robot with a clock of its own come in time."""

import math
from collections.abc import Mapping
from typing import Any

from selfmodel.trials.behaviour import StepTiming

TIME = "time"
"""What an observation may tell beside our signals: when it was made, s, by the robot's clock."""


class Stopwatch:
    """Tells each step's moment.

    Where the first observation says when it was made, only what observations say counts; otherwise
    only the clock does.

    Args:
        timestep: What is to lie between two steps, s.
        tolerance: By how much of that a step may be off.
    """

    def __init__(self, timestep: float, tolerance: float) -> None:
        self._timestep, self._tolerance = timestep, tolerance
        self._zero = self._last = math.nan
        self._since = 0
        self._stamped = False

    def look(self, now: float, told: Mapping[str, Any] | None) -> StepTiming:
        """Returns the moment of the next step.

        An observation that is not newer than the one before is that one again: it is missing.

        Args:
            now: What the clock says, s.
            told: What was observed; None if nothing was.
        """
        stamp = float("nan" if told is None else told.get(TIME, "nan"))
        if math.isinf(stamp):  # no time: a log could not hold it
            stamp = math.nan
        if math.isnan(self._zero):
            self._stamped = not math.isnan(stamp)
            self._zero = stamp if self._stamped else now
        elapsed = (stamp if self._stamped else now) - self._zero
        self._since += 1
        if math.isnan(elapsed) or (self._stamped and elapsed <= self._last):
            # Without a time an observation may be of any moment.
            unknown = math.isnan(elapsed) and told is not None
            return StepTiming(math.nan, late=unknown, missing=not unknown)
        off = abs(elapsed - self._last - self._since * self._timestep)
        self._last, self._since = elapsed, 0
        # Nothing is before the first: its NaN is never late.
        return StepTiming(
            elapsed, late=off > self._tolerance * self._timestep, missing=told is None
        )
