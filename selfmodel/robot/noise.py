"""The noise of sensors that a hypothesis calls noisy."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.embodiment import Embodiment


class SensorNoise:
    """Adds noise to readings, step by step, for many robots.

    Each robot has a sequence a sensor, which its embodiment's seed and the sensor's column give:
    the same in any batch, and for every hypothesis of one seed, so that the noise itself does not
    tell hypotheses apart.

    Args:
        embodiments: With the standard deviations of their sensors.
        copies: Robots of each embodiment, side by side; each copy has a sequence of its own.
    """

    def __init__(self, embodiments: Sequence[Embodiment], copies: int = 1) -> None:
        self._copies = copies
        deviations = np.array([embodiment.noise for embodiment in embodiments])
        noisy: dict[tuple[int, int], list[int]] = {}
        for row, column in zip(*np.nonzero(deviations), strict=True):
            noisy.setdefault((embodiments[row].seed, int(column)), []).append(int(row))
        self._noisy = [
            (np.random.default_rng(stream), rows, stream[1], deviations[rows, stream[1]])
            for stream, rows in noisy.items()
        ]

    def add(self, readings: FloatArray) -> None:
        """Adds the next step's noise to the readings, ``(embodiments * copies, sensors)``."""
        robots, sensors = readings.shape
        by_copy = readings.reshape(robots // self._copies, self._copies, sensors)
        for stream, rows, column, deviations in self._noisy:
            drawn = stream.standard_normal(self._copies)
            by_copy[rows, :, column] += np.outer(deviations, drawn)
