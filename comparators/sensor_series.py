"""Does the robot sense and move, moment by moment, as the simulation says?"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.comparators.bounded import bounded
from selfmodel.comparators.observed import observed_signals
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.signal_difference import comparable
from selfmodel.trials.trial import Trial

BLOCK = 5
"""Control steps that are averaged before anything is compared: noise and jitter shrink."""
BLOCKS = 5
"""Blocks in a window; a window is a piece of the trial."""
FADE = 400.0
"""Control steps over which the weight of a window falls to 1/e."""
LAGS = (-10, -5, 0, 5, 10)
"""Control steps by which a simulation may be ahead of the trial in a window."""

FLOORS: dict[Signal, float] = {
    "sensors": 0.1,
    "joint_positions": 0.05,
    "base_orientation": 0.1,
    "base_linear_velocity": 0.1,
    "base_position": 0.05,
}
"""The least spread that a column is scaled by, in the signal's unit: a column that stands still
in the trial must not make a small difference infinite."""


@dataclass(frozen=True)
class SensorSeries:
    """The difference of time series over a whole trial, by windows that count less and less.

    Every column is divided by its spread (standard deviation) in the logged trial, so that radians
    weigh as much as metres, and every signal as much as every other. The differences are averaged
    over blocks of 5 steps and their bounded loss over windows of 25, each window at the lag of up
    to 10 steps that suits it best, so that a late stride is not a wrong one. A window's weight
    falls to 1/e in 400 steps, because contact is chaotic: from some step on, even a right
    hypothesis is as far away as a wrong one, and the bounded loss adds nearly the same to both. A
    base's orientation is compared as the direction of gravity that it feels and the horizontal
    part of where it points. What was not observed in the trial is not compared.

    Source: the paper names the comparison of sensor time series as future work, because
    displacement alone did not tell some compounds of failures. Windows, lags and weights are
    choices made here.

    Limits: beyond the lag, a stride that begins late is a wrong stride, and a gap between model
    and robot makes strides late sooner or later. A failure that shows late is weighed little. Two
    neighbouring windows are not independent, which a paired test over them should know.

    Attributes:
        name: What it is called.
        signals: What it compares, of the keys of ``FLOORS``; of these it needs one at least.
    """

    name: str = "sensor-series"
    signals: tuple[Signal, ...] = tuple(FLOORS)

    def request(self, trial: Trial) -> ClosedLoop:
        """Returns that it looks at those of its signals that the trial has.

        Raises:
            InputError: The trial has none of them.
        """
        return ClosedLoop(record=observed_signals(trial, self.signals, self.name))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the distance of each simulation, ``(n,)``, from 0 to 1."""
        return np.asarray(self.losses(simulated, trial).mean(axis=1))

    def losses(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Returns the loss of each window, weighted so that their mean is the distance.

        Returns:
            ``(n, windows)``.
        """
        steps = trial.behaviour.steps
        windows = -(-steps // (BLOCK * BLOCKS))
        signals = observed_signals(trial, self.signals, self.name)
        late = np.clip(np.arange(steps) + np.array(LAGS)[:, np.newaxis], 0, steps - 1)
        loss = np.zeros((len(LAGS), len(simulated[signals[0]]), windows))
        weight = np.zeros(windows)
        for signal in signals:
            logged = comparable(signal, trial.behaviour[signal])
            seen = np.isfinite(logged)
            counted, share = _shares(seen, windows)
            scale = counted * _spread(logged, seen, FLOORS[signal])
            moved = comparable(signal, simulated[signal])
            for lag, rows in enumerate(late):
                blocks = _blocks(moved[:, rows] - logged, seen)
                terms = bounded(blocks / scale).reshape(len(moved), windows, -1)
                loss[lag] += (terms * share).sum(axis=2)
            weight += share.sum(axis=1)
        # From the first window of which anything was seen, however late that is.
        age = np.arange(windows) - np.flatnonzero(weight)[0]
        fading = np.exp(-np.maximum(age, 0) * (BLOCK * BLOCKS / FADE)) * (weight > 0)
        weight = np.where(weight > 0, weight, 1)
        return np.asarray(loss.min(axis=0) / weight * (fading / fading.mean()))


def _blocks(difference: FloatArray, seen: BoolArray) -> FloatArray:
    """Sums over blocks of steps of what was seen, ``(n, blocks of whole windows, columns)``."""
    runs, steps, columns = difference.shape
    whole = -(-steps // (BLOCK * BLOCKS)) * BLOCK * BLOCKS
    padded = np.zeros((runs, whole, columns))
    np.copyto(padded[:, :steps], difference, where=seen)
    return np.asarray(padded.reshape(runs, -1, BLOCK, columns).sum(axis=2))


def _shares(seen: BoolArray, windows: int) -> tuple[FloatArray, FloatArray]:
    """How many steps of each block were seen, and what its loss counts in its window.

    Returns:
        ``(blocks, columns)``, at least 1; and ``(windows, blocks of a window * columns)``, of
        which a window of which all was seen has a sum of 1.
    """
    counted = _blocks(np.ones((1, *seen.shape)), seen)[0]
    share = (counted > 0) / (BLOCKS * seen.shape[1])
    return np.maximum(counted, 1), share.reshape(windows, -1)


def _spread(logged: FloatArray, seen: BoolArray, floor: float) -> FloatArray:
    """The standard deviation of each column of the trial where it was seen, ``(columns,)``."""
    count = np.maximum(seen.sum(axis=0), 1)
    known = np.where(seen, logged, 0)
    centred = np.where(seen, logged - known.sum(axis=0) / count, 0)
    return np.asarray(np.maximum(np.sqrt((centred * centred).sum(axis=0) / count), floor))


SENSOR_SERIES = SensorSeries()
