"""The controller's readings and arithmetic in segments of a trial, against a hypothesis.

The loss of the readings has three parts: switches, graded readings, and the noise level of single
sensors, which serves the fault kind ``sensor-noise`` only: noise has no predictable values, but a
level. The controller's arithmetic needs no physics, so a nonzero error is a fault of the
controller itself.
"""

import math
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray, mean_of_known
from selfmodel.controllers.controller import TARGET_RANGE, make_batch
from selfmodel.controllers.playback import Playback
from selfmodel.trials.signals import PREDICTION_ERROR_SCALES
from selfmodel.trials.trial import Trial

CONTRADICTION = 3.0
"""Factor on the loss of a binary reading that changes although no change is ever predicted."""

ORDER = 4
"""Order of the differences between neighbouring readings: high enough to suppress even fast motion,
and not noise."""

RATIO, MARGIN = 2.0, 0.06
"""A sensor's noise level counts if it exceeds RATIO times the median of the other sensors' plus
MARGIN, in a reading's unit. All sensors have measurement noise; an excess of one is a fault."""

NOISE_ERROR_SCALE = 0.05
"""Error of a predicted noise level that counts as large, in a reading's unit."""


class LoggedReadings(NamedTuple):
    """The readings of the controller in the segments of a trial.

    Attributes:
        values: Readings, ``(segments, horizon + 1, sensors)``; NaN if unknown.
        binary: Mask of the sensors whose readings in the whole trial are 0 or 1, ``(sensors,)``;
            False for a sensor that was never observed.
        mid_trial: Mask of the segments that begin after the start of the trial, ``(segments,)``.
    """

    values: FloatArray
    binary: BoolArray
    mid_trial: BoolArray

    def of(self, own: slice) -> "LoggedReadings":
        """Returns the readings in some of the segments."""
        return LoggedReadings(self.values[own], self.binary, self.mid_trial[own])


def logged_readings(logged: FloatArray, starts: IndexArray, horizon: int) -> LoggedReadings:
    """Returns the readings in the segments of a trial, of all readings ``(steps, sensors)``."""
    unknown = np.isnan(logged)
    binary = (np.isin(logged, (0.0, 1.0)) | unknown).all(axis=0) & ~unknown.all(axis=0)
    rows = starts[:, np.newaxis] + np.arange(horizon + 1)
    return LoggedReadings(logged[rows], np.asarray(binary), starts > 0)


def readings_loss(predicted: FloatArray, logged: LoggedReadings, steady: BoolArray) -> FloatArray:
    """Returns the loss of the predicted readings, ``(n, segments)``.

    The first row of a segment follows from the state alone. Angles are certain there, but touches
    only at the start of the trial, in the initial pose: elsewhere, millimetres decide. The loss of
    the noise levels is estimated from all segments together, and added to each.
    """
    predicts_binary = np.isin(predicted, (0.0, 1.0)).all(axis=(1, 2))
    switches = np.asarray(logged.binary & predicts_binary)
    never = np.asarray(switches & ~predicted.any(axis=(1, 2)))
    errors = predicted - logged.values
    graded = np.log1p(np.square(errors / PREDICTION_ERROR_SCALES["sensors"]))
    switched = np.abs(errors) * np.where(never, CONTRADICTION, 1.0)[:, None, None]
    switched[:, logged.mid_trial, 0] *= 0.0  # an unknown reading remains NaN
    losses = finite_mean(np.where(switches[:, None, None], switched, graded))
    observed = ~np.isnan(logged.values).all(axis=(0, 1))
    graded_sensors = np.asarray(observed & ~switches)
    noise = noise_level_loss(predicted[:, steady], logged.values[steady], graded_sensors)
    return losses + noise[:, np.newaxis]


def arithmetic_loss(trial: Trial, starts: IndexArray, horizon: int) -> FloatArray:
    """Returns the loss of the logged commands against the controller's, ``(segments,)``."""
    scale = PREDICTION_ERROR_SCALES["commands"] * command_spans(trial)
    errors = command_errors(trial) / scale
    rows = starts[:, np.newaxis] + np.arange(1, horizon + 1)
    return finite_mean(np.log1p(np.square(errors[rows])))


def command_errors(trial: Trial) -> FloatArray:
    """Returns the difference between the logged commands and those of the controller.

    Returns:
        ``(steps, motors)`` in each motor's unit, exactly 0 where the robot executed its controller.
        NaN from the first reading that was not observed, because the controller's state is unknown
        from there. All 0 for a playback, whose controller is unknown, and for a policy that
        observes more than the readings: that is logged with other noise, or not at all.
    """
    trajectory, source = trial.trajectory, trial.plan.controller
    commands, readings = trajectory["commands"], trajectory["sensors"]
    if isinstance(source, Playback) or source.design.observes:
        return np.zeros_like(commands)
    batch = make_batch([source], [frozenset()], readings.shape[1])
    errors = np.full_like(commands, np.nan)
    expected = np.empty((1, commands.shape[1]))
    for step in range(len(commands)):
        if not np.isfinite(readings[step]).all():
            break
        batch.readings[0] = readings[step]
        batch.step(expected)
        errors[step] = commands[step] - expected[0]
    return errors


def command_spans(trial: Trial) -> FloatArray:
    """Returns the width of each motor's command range relative to the paper's, ``(motors,)``.

    All 1 for a playback, whose command ranges are unknown.
    """
    source = trial.plan.controller
    if isinstance(source, Playback):
        return np.ones(len(source.motors))
    return np.array([half / TARGET_RANGE for _, half in source.design.ranges])


def finite_mean(values: FloatArray) -> FloatArray:
    """Returns the mean of the finite values over the last two axes; 0 if there are none."""
    if np.isfinite(values).all():
        return np.asarray(values.mean(axis=(-2, -1)))
    return mean_of_known(values, axis=(-2, -1), empty=0.0)


def noise_level_loss(predicted: FloatArray, logged: FloatArray, graded: BoolArray) -> FloatArray:
    """Returns the loss of the predicted noise levels of the sensors, ``(n,)``.

    Per reading, a hypothesis with noise predicts worse than one without, because its noise values
    differ from those of the log. Noise levels are comparable. The loss is the mean over the sensors
    of ``log(1 + (e / NOISE_ERROR_SCALE)^2)``, with e the error of the noise level; exactly 0 if no
    sensor has an excess of noise in the log or in the prediction.

    Args:
        predicted: Predicted readings, ``(n, segments, rows, sensors)``.
        logged: Logged readings, ``(segments, rows, sensors)``; NaN if unknown.
        graded: Mask of the sensors with readings other than 0 and 1, ``(n, sensors)``.
    """
    _, rows, sensors = logged.shape
    if rows <= ORDER or not sensors:
        return np.zeros(len(predicted))
    excess = _excess(logged[np.newaxis], graded)
    error = (_excess(predicted, graded) - excess) / NOISE_ERROR_SCALE
    return np.asarray(np.log1p(np.square(error)).mean(axis=1))


def _excess(readings: FloatArray, graded: BoolArray) -> FloatArray:
    """Returns the standard deviation of each sensor's noise beyond the usual noise."""
    noise = np.where(graded, _noise_level(readings), np.nan)
    usual = _median_of_others(noise)
    beyond = noise > RATIO * usual + MARGIN
    return np.sqrt(np.where(beyond, np.square(noise) - np.square(usual), 0.0))


def _noise_level(readings: FloatArray) -> FloatArray:
    """Returns the standard deviation of white noise with the same differences, ``(n, sensors)``.

    The median of the differences is robust against impacts.
    """
    steps = np.abs(np.diff(readings, ORDER, axis=2))
    n, _, _, sensors = steps.shape
    by_sensor = steps.transpose(0, 3, 1, 2).reshape(n, sensors, -1)
    # 0.6745 is the median of the absolute value of a standard normal variable.
    return _median(by_sensor) / (0.6745 * math.sqrt(math.comb(2 * ORDER, ORDER)))


def _median(values: FloatArray) -> FloatArray:
    """Returns the median over the last axis of the finite values; NaN if there are none."""
    ordered = np.sort(values, axis=-1)  # NaN comes last
    known = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    middle = np.take_along_axis(ordered, np.maximum(known - 1, 0) // 2, axis=-1)
    return np.asarray(middle[..., 0])


def _median_of_others(noise: FloatArray) -> FloatArray:
    """Returns for each column the median of the other columns; NaN if there are no others."""
    sensors = noise.shape[1]
    others = np.where(np.eye(sensors, dtype=bool), np.nan, noise[:, np.newaxis, :])
    return _median(others)
