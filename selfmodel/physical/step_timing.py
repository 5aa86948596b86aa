"""Step timing of a robot with its own clock: measured times, late steps and missing steps."""

import math
from collections.abc import Mapping
from typing import Any

from selfmodel.trials.behaviour import StepTiming

TIMESTAMP = "time"
"""Optional key of an observation, beside the signals: its time by the robot's clock, s."""


class StepTimer:
    """Computes the timing of each control step.

    If the first observation has a timestamp, all times are timestamps of observations; otherwise
    all times are readings of the clock.

    Args:
        timestep: Control time step, s.
        tolerance: Largest deviation of a punctual step, as a fraction of the control time step.
    """

    def __init__(self, timestep: float, tolerance: float) -> None:
        self._timestep, self._tolerance = timestep, tolerance
        self._origin = self._last_elapsed = math.nan
        self._steps_since_last = 0
        self._has_timestamps = False

    def update(self, now: float, observation: Mapping[str, Any] | None) -> StepTiming:
        """Returns the timing of the next step.

        An observation that is not newer than the previous observation is a repetition, and counts
        as missing.

        Args:
            now: Reading of the clock, s.
            observation: The observation; None if there is no observation.
        """
        timestamp = float("nan" if observation is None else observation.get(TIMESTAMP, "nan"))
        if math.isinf(timestamp):  # a log cannot contain an infinite time
            timestamp = math.nan
        if math.isnan(self._origin):
            self._has_timestamps = not math.isnan(timestamp)
            self._origin = timestamp if self._has_timestamps else now
        elapsed = (timestamp if self._has_timestamps else now) - self._origin
        self._steps_since_last += 1
        if math.isnan(elapsed) or (self._has_timestamps and elapsed <= self._last_elapsed):
            # The time of an observation without a timestamp is unknown.
            unknown = math.isnan(elapsed) and observation is not None
            return StepTiming(math.nan, late=unknown, missing=not unknown)
        deviation = abs(elapsed - self._last_elapsed - self._steps_since_last * self._timestep)
        self._last_elapsed, self._steps_since_last = elapsed, 0
        # The deviation of the first step is NaN, which is never late.
        return StepTiming(
            elapsed,
            late=deviation > self._tolerance * self._timestep,
            missing=observation is None,
        )
