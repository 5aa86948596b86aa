"""Difference of sensor and motion time series over a whole trial."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.diagnosis.comparator import Prepared, TrialRefusedError
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.trials.signals import SERIES_SPREAD_FLOORS, Signal, comparable
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

BLOCK, BLOCKS = 5, 5
"""Control steps that are averaged before the comparison, to reduce noise and jitter, and blocks of
a window."""
WINDOW = BLOCK * BLOCKS
"""Control steps of a window."""
DECAY = 400.0
"""Control steps over which the weight of a window falls to 1/e."""
LAGS = (-10, -5, 0, 5, 10)
"""Control steps by which a simulation may be ahead of the trial in a window."""


@dataclass(frozen=True)
class SensorSeries:
    """The difference of time series over a whole trial, by windows of decreasing weight.

    Every column is divided by its standard deviation in the logged trial, so that radians weigh as
    much as metres, and every signal as much as every other. The differences are averaged over
    blocks of 5 steps and their bounded loss over windows of 25, each window at the lag of up to 10
    steps with the smallest loss, so that a late stride does not count as a wrong one. A window's
    weight falls to 1/e in 400 steps, because contact is chaotic: from some step on, even the true
    hypothesis is as far from the trial as a wrong one, and the bounded loss adds nearly the same to
    both. The base's orientation is compared as the direction of gravity in the base's frame and the
    horizontal part of the forward direction. Unobserved values of the trial are left out.

    Source: the paper names the comparison of sensor time series as future work, because
    displacement alone did not distinguish some compounds of failures. Windows, lags and weights are
    selfmodel's choices.

    Limits: beyond the lag, a stride that begins late counts as wrong, and a gap between model and
    robot makes strides late sooner or later. A failure that shows late has little weight.
    Neighbouring windows are not independent.

    Attributes:
        name: The comparator's name.
        signals: The compared signals, of the keys of ``SERIES_SPREAD_FLOORS``.
    """

    name: str = "sensor-series"
    signals: tuple[Signal, ...] = tuple(SERIES_SPREAD_FLOORS)

    def prepare(self, trial: Trial) -> Prepared:
        """Returns the observed series of the trial, with their scales and weights."""
        signals = observed_signals(trial, self.signals, self.name)
        windows = -(-trial.trajectory.steps // WINDOW)
        columns = {
            signal: _scaled_columns(signal, trial.trajectory[signal], windows) for signal in signals
        }
        weight = np.zeros(windows)
        for column in columns.values():
            weight += column.share.sum(axis=1)
        # The decay begins at the first window with an observation.
        age = np.arange(windows) - np.flatnonzero(weight)[0]
        decay = np.exp(-np.maximum(age, 0) * (WINDOW / DECAY)) * (weight > 0)
        weights = np.where(weight > 0, weight, 1), decay / decay.mean()
        return Prepared(ClosedLoop(record=signals), partial(_losses, columns, *weights))


class ScaledColumns(NamedTuple):
    """The columns of one signal of a trial, with their scales and weights.

    Attributes:
        logged: Comparable columns of the logged signal, ``(steps, columns)``.
        observed: Mask of the observed values, ``(steps, columns)``.
        scale: Observed steps of each block times the column's spread, ``(blocks, columns)``.
        share: Weight of each block's loss in its window, ``(windows, BLOCKS * columns)``; the sum
            over a window that was observed completely is 1.
    """

    logged: FloatArray
    observed: BoolArray
    scale: FloatArray
    share: FloatArray


def _losses(
    series: Mapping[Signal, ScaledColumns],
    weight: FloatArray,
    relative_decay: FloatArray,
    simulated: Trajectory,
) -> FloatArray:
    """Returns the loss of each window, weighted so that their mean is the distance.

    Args:
        series: The columns of each observed signal.
        weight: Sum of the shares in each window, ``(windows,)``; 1 if nothing was observed.
        relative_decay: Weight of each window over the mean weight, ``(windows,)``; 0 if nothing was
            observed.
        simulated: The simulations.
    """
    runs = len(simulated[next(iter(series))])
    steps = len(next(iter(series.values())).logged)
    lagged = np.clip(np.arange(steps) + np.array(LAGS)[:, np.newaxis], 0, steps - 1)
    loss = np.zeros((len(LAGS), runs, len(weight)))
    for signal, columns in series.items():
        values = comparable(signal, simulated[signal])
        for lag, rows in enumerate(lagged):
            blocks = _block_sums(values[:, rows] - columns.logged, columns.observed)
            terms = geman_mcclure(blocks / columns.scale).reshape(runs, len(weight), -1)
            loss[lag] += (terms * columns.share).sum(axis=2)
    return np.asarray(loss.min(axis=0) / weight * relative_decay)


def _scaled_columns(signal: Signal, values: FloatArray, windows: int) -> ScaledColumns:
    logged = comparable(signal, values)
    observed = np.isfinite(logged)
    counts = _block_sums(np.ones((1, *observed.shape)), observed)[0]
    share = (counts > 0) / (BLOCKS * observed.shape[1])
    scale = np.maximum(counts, 1) * _spread(logged, observed, SERIES_SPREAD_FLOORS[signal])
    return ScaledColumns(logged, observed, scale, share.reshape(windows, -1))


def _block_sums(values: FloatArray, observed: BoolArray) -> FloatArray:
    """Returns the sum of the observed values in each block, ``(n, blocks, columns)``."""
    runs, _, columns = values.shape
    windows = padded_windows(values, WINDOW, observed)
    return np.asarray(windows.reshape(runs, -1, BLOCK, columns).sum(axis=2))


def _spread(logged: FloatArray, observed: BoolArray, floor: float) -> FloatArray:
    """Returns the standard deviation of each column's observed values, ``(columns,)``."""
    count = np.maximum(observed.sum(axis=0), 1)
    known = np.where(observed, logged, 0)
    centred = np.where(observed, logged - known.sum(axis=0) / count, 0)
    return np.asarray(np.maximum(np.sqrt((centred * centred).sum(axis=0) / count), floor))


def observed_signals(
    trial: Trial, signals: Iterable[Signal], comparator: str
) -> tuple[Signal, ...]:
    """Returns the signals that have a finite value in the trial; refuses a trial without any."""
    wanted = tuple(signals)
    observed = tuple(signal for signal in wanted if np.isfinite(trial.trajectory[signal]).any())
    if not observed:
        raise TrialRefusedError(
            f"{trial.path}: {comparator} needs at least one of {', '.join(wanted)}, and the log "
            f"has none of them",
            "leave this log out, or give another comparator",
        )
    return observed


def padded_windows(
    values: FloatArray | BoolArray, length: int, observed: BoolArray | None = None
) -> FloatArray:
    """Returns time series cut into windows, the last filled up with 0.

    Args:
        values: ``(..., steps, columns)``.
        length: Steps of a window.
        observed: Mask that broadcasts to ``values``; values outside of it may be NaN and become 0.

    Returns:
        ``(..., windows, length, columns)``.
    """
    *batch, steps, columns = values.shape
    windows = -(-steps // length)
    padded = np.zeros((*batch, windows * length, columns))
    np.copyto(padded[..., :steps, :], values, where=True if observed is None else observed)
    return padded.reshape(*batch, windows, length, columns)


def geman_mcclure(residuals: FloatArray) -> FloatArray:
    """Returns the loss u² / (1 + u²) of residuals u, which no single outlier can dominate.

    Source: Geman and McClure, "Statistical methods for tomographic image reconstruction", Bulletin
    of the International Statistical Institute 52 (1987).
    """
    squared = residuals * residuals
    return squared / (1 + squared)


SENSOR_SERIES = SensorSeries()
