"""A sequential test for a change, whose threshold aims at a mean time between false alarms.

Each segment gives e-values, one of each channel (joint, sensor or signal). Were their expected
value, given all segments before, at most 1 as long as the robot is healthy, the aim would be
proven: it holds on average over healthy trials, not given those of a watch; see ``reference``. The
Shiryaev-Roberts recursion ``M = e * (M + 1)`` of a channel has an expected value of at most the
number of segments, at any time that may be chosen while it runs, and so has the mean over the
channels. An alarm at ``M >= A`` would come, on average, after ``A`` healthy segments or more.

Source: Shin, Ramdas & Rinaldo, "E-detectors: a nonparametric framework for sequential change
detection", New England Journal of Statistics in Data Science 2 (2023).
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import FloatArray

MEMORY = 400
"""Segments before an alarm among which its onset is sought."""

COVERED = 0.95
"""Share of the evidence that the interval of an onset has."""

MAX_SHOWN = 4
"""Channels that are named as those that show a change."""


class Onset(NamedTuple):
    """Ages of segments, 0 for the newest: of the first changed one, and the bounds of its age."""

    age: int
    oldest: int
    newest: int


class Detector:
    """Mean over channels of e-detectors by Shiryaev and Roberts; see the module.

    The run length is that of healthy segments before a false alarm, aimed at on average.
    """

    def __init__(self, run_length: float) -> None:
        self._threshold = run_length
        self._evidence: FloatArray | float = 0.0
        self._recent: deque[FloatArray] = deque(maxlen=MEMORY)

    def update(self, log_e: FloatArray) -> bool:
        """Adds the logarithms of the e-values of a segment, ``(channels,)``; True for an alarm."""
        self._evidence = np.exp(log_e) * (self._evidence + 1.0)
        self._recent.append(log_e)
        return bool(np.mean(self._evidence) >= self._threshold)

    def onset(self) -> Onset:
        """Returns where the change began: each segment weighs by the evidence from it on."""
        since = np.cumsum(np.array(self._recent)[::-1], axis=0)  # by age
        weights = np.exp(since - since.max()).sum(axis=1)
        share = np.cumsum(weights) / weights.sum()
        outside = (1 - COVERED) / 2
        newest, oldest = np.searchsorted(share, (outside, 1 - outside)).tolist()
        return Onset(int(np.argmax(weights)), min(oldest, len(share) - 1), newest)

    def shown_by(self) -> list[int]:
        """Returns the channels with the most evidence since the onset, the clearest first."""
        log_e = np.array(self._recent)[-1 - self.onset().age :].sum(axis=0)
        order = np.argsort(-log_e, kind="stable")[:MAX_SHOWN]
        return [int(k) for k in order if log_e[k] > 0]
