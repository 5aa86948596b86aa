"""Joint encoders against a hypothesis: their motion, single hinges, and those of detached limbs.

The error of a predicted angle contains little of a jam or of a fault of one joint: its scale allows
for a reality gap, and is larger than the motion of many a joint.

- **Motion**: an encoder that moves is evidence against a jam, one that stands while its joint is
  commanded is evidence for a jam. Both are compared at the encoder's own noise.
- **Hinges**: a fault of one joint changes the motion of that joint far more than anything else. In
  the mean over all hinges, and beside the contacts of the feet, little of it is left. So each hinge
  has a loss of its own.
- **Detached limbs**: the encoder of a joint whose limb is lost is not predicted by the model of the
  robot. Often the encoder belongs to the motor and stays: it then measures the motor's own motion,
  which follows the commands with a lag. Such an encoder is no evidence against the loss.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray, held, median_of_known
from selfmodel.simulation.requests import END
from selfmodel.trials.estimation import standing_tolerance
from selfmodel.trials.signals import HINGE_ERROR_SCALES, Signal
from selfmodel.trials.trajectory import Trajectory

ERROR_SCALE = 0.5
"""Error of the natural logarithm of a motion that counts as large: a factor of 1.6."""

MIN_ROWS = 4
"""Known angles of a hinge that a segment needs for its motion."""

TIME_CONSTANTS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Time constants of a motor without a load that are tried, control steps: its angle follows the
command as the output of a low-pass filter of first order."""

MAX_REMAINDER = 0.1
"""Largest share of the variance of an encoder that a linear function of commands may leave if the
encoder follows them."""

DERIVED = 0.999
"""Smallest correlation of a reading with an angle from which it is derived."""

MIN_KNOWN, MIN_VARIANCE = 20, 1e-6
"""Known rows that a fit needs, and their variance, rad^2: that of a milliradian."""


class LoggedMotion(NamedTuple):
    """Motion of the encoders in the segments of a trial.

    The motion is a mean square deviation, rad^2; NaN without enough known angles.

    Attributes:
        within: Motion around the mean of the segment, ``(segments, hinges)``.
        overall: Motion in the segment around the median of the trial's end, ``(segments, hinges)``.
        tolerance: Motion that counts as none, ``(hinges,)``: both motions that are compared are
            increased by it, so that the noise of the log alone is a small error.
        known: Mask of the known angles, ``(segments, horizon + 1, hinges)``.
    """

    within: FloatArray
    overall: FloatArray
    tolerance: FloatArray
    known: BoolArray

    def of(self, own: slice) -> "LoggedMotion":
        """Returns the motion in some of the segments."""
        return LoggedMotion(self.within[own], self.overall[own], self.tolerance, self.known[own])


def logged_motion(positions: FloatArray, starts: IndexArray, horizon: int) -> LoggedMotion:
    """Returns the motion of the encoders in the segments of a trial.

    Args:
        positions: Logged joint positions, ``(steps, hinges)`` rad; NaN where unknown.
        starts: Step at which each segment of ``horizon`` steps begins, ``(segments,)``.
        horizon: Control steps of a segment.
    """
    angles = np.where(np.isfinite(positions), positions, np.nan)
    rows = angles[starts[:, np.newaxis] + np.arange(horizon + 1)]
    known = np.isfinite(rows)
    end = median_of_known(angles[round((1 - END) * len(angles)) :])
    return LoggedMotion(
        within=_motion(rows, known),
        overall=_mean(np.square(rows - end), known),
        tolerance=np.square(standing_tolerance(angles)),
        known=known,
    )


def encoder_motion_loss(simulated: Trajectory, logged: LoggedMotion) -> FloatArray:
    """Returns the loss of the predicted motion of the encoders, ``(n, segments)``.

    The error of a hinge is half the logarithm of the ratio of two mean square deviations, of the
    log and of the prediction, each increased by the tolerance. It is 0 for equal motions, and grows
    with the logarithm of their ratio. A welded hinge is predicted to stand at one angle during the
    whole trial, so the log's motion around the trial's median counts; for other hinges, that around
    the segment's mean. The encoder of a detached hinge contains no information: it may freeze, fail
    or follow its motor.

    Args:
        simulated: Predicted signals, ``(n, segments, horizon + 1, width)`` each.
        logged: The motion in the log.

    Returns:
        The mean over the informative hinges of ``log(1 + (e / ERROR_SCALE)^2)``; 0 without any.
    """
    predicted = simulated["joint_positions"]
    welded, detached = simulated.hinge_mask("welded"), simulated.hinge_mask("detached")
    motion = np.where((welded | detached)[:, np.newaxis], logged.overall, logged.within)
    ratio = (motion + logged.tolerance) / (_motion(predicted, logged.known) + logged.tolerance)
    losses = np.log1p(np.square(0.5 * np.log(ratio) / ERROR_SCALE))
    informative = np.isfinite(motion) & ~detached[:, np.newaxis]
    total = np.where(informative, losses, 0.0).sum(axis=-1)
    return np.asarray(total / np.maximum(informative.sum(axis=-1), 1))


def _motion(angles: FloatArray, known: BoolArray) -> FloatArray:
    """Returns the mean square deviation from the mean over the known rows."""
    mean = _mean(angles, known)[..., np.newaxis, :]
    return _mean(np.square(angles - mean), known)


def _mean(
    values: FloatArray, known: BoolArray, least: int = MIN_ROWS, unknown: float = np.nan
) -> FloatArray:
    """Returns the mean over the known rows, of the last but one axis; ``unknown`` for too few."""
    count = known.sum(axis=-2)
    total = np.where(known, values, 0.0).sum(axis=-2)
    return np.where(count >= least, total / np.maximum(count, 1), unknown)


def hinge_losses(
    simulated: Trajectory, logged: Mapping[Signal, FloatArray], compared: IndexArray
) -> FloatArray:
    """Returns the loss of each hinge in each segment, ``(n, segments, hinges)``.

    The loss is the mean of ``log(1 + (e / s)^2)`` over the compared steps, of the angle plus of the
    velocity. It is NaN where the angle is unknown, and for a hypothesis that detaches the hinge.

    Args:
        simulated: Predicted signals, ``(n, segments, horizon + 1, width)`` each.
        logged: Logged state at the compared steps, ``(segments, comparisons, width)`` per signal.
        compared: Steps within a segment at which the state is compared, ``(comparisons,)``.
    """
    positions = simulated["joint_positions"]
    total = np.zeros((*positions.shape[:2], positions.shape[-1]))
    for signal, scale in HINGE_ERROR_SCALES.items():
        if signal in logged:
            losses = np.log1p(
                np.square((simulated[signal][:, :, compared] - logged[signal]) / scale)
            )
            unknown = np.nan if signal == "joint_positions" else 0.0
            total += _mean(losses, np.isfinite(losses), 1, unknown)
    return np.where(simulated.hinge_mask("detached")[:, np.newaxis], np.nan, total)


class LooseEncoders(NamedTuple):
    """Angles of encoders that follow commands, and the readings that are derived from them.

    Attributes:
        hinges: Columns of the encoders that follow commands.
        angles: Their fitted angles in the segments, ``(segments, horizon + 1, hinges)`` rad.
        velocities: Velocities of the fitted angles, likewise, rad/s.
        sensors: Columns of the readings derived from these hinges.
        readings: The derived readings, ``(segments, horizon + 1, sensors)``.
        source: Index into ``hinges`` of each of these readings.
    """

    hinges: IndexArray
    angles: FloatArray
    velocities: FloatArray
    sensors: IndexArray
    readings: FloatArray
    source: IndexArray

    def of(self, own: slice) -> "LooseEncoders":
        """Returns the encoders in some of the segments."""
        return self._replace(
            angles=self.angles[own], velocities=self.velocities[own], readings=self.readings[own]
        )


def loose_encoders(
    trajectory: Trajectory, starts: IndexArray, horizon: int
) -> LooseEncoders | None:
    """Returns the encoders of a trial that follow commands; None if there are none.

    Encoders of intact joints may be among them: they are used only for hypotheses that detach the
    joint.
    """
    commands, logged = trajectory["commands"], trajectory["joint_positions"]
    filtered = _low_passes(commands)
    first = round((1 - END) * trajectory.steps)
    fits = [_following(column, filtered, first) for column in logged.T]
    hinges = np.array([i for i, fit in enumerate(fits) if fit is not None], dtype=np.intp)
    if not len(hinges):
        return None
    angles = np.stack([fit for fit in fits if fit is not None], axis=1)
    velocities = np.gradient(angles, trajectory.time, axis=0)
    derived = []
    for sensor, readings in enumerate(trajectory["sensors"].T):
        for source, hinge in enumerate(hinges):
            line = _line(readings[first:], logged[first:, hinge])
            if line is not None and line[2] < 1 - DERIVED**2:
                derived.append((sensor, source, line[0] + line[1] * angles[:, source]))
    rows = starts[:, np.newaxis] + np.arange(horizon + 1)
    readings = [values for _, _, values in derived]
    return LooseEncoders(
        hinges=hinges,
        angles=angles[rows],
        velocities=velocities[rows],
        sensors=np.array([sensor for sensor, _, _ in derived], dtype=np.intp),
        readings=np.stack(readings, axis=1)[rows] if readings else np.empty((*rows.shape, 0)),
        source=np.array([source for _, source, _ in derived], dtype=np.intp),
    )


def with_loose_encoders(simulated: Trajectory, loose: LooseEncoders) -> Mapping[Signal, FloatArray]:
    """Returns predictions in which the encoders of detached hinges follow their commands."""
    detached = simulated.hinge_mask("detached")
    followed: dict[Signal, tuple[IndexArray, FloatArray, IndexArray]] = {
        "joint_positions": (loose.hinges, loose.angles, loose.hinges),
        "joint_velocities": (loose.hinges, loose.velocities, loose.hinges),
        "sensors": (loose.sensors, loose.readings, loose.hinges[loose.source]),
    }
    changed = {signal: simulated[signal].copy() for signal in followed}
    for signal, (columns, values, hinges) in followed.items():
        for k, (column, hinge) in enumerate(zip(columns, hinges, strict=True)):
            changed[signal][detached[:, hinge], :, :, column] = values[:, :, k]
    return {**simulated.signals, **changed}


def _following(angles: FloatArray, filtered: FloatArray, first: int) -> FloatArray | None:
    """Returns the linear function of one motor's commands that an encoder follows, ``(steps,)``.

    It is fitted from a first row on, because the limb may be lost during the trial. None if the
    encoder is not such a function, or stands.
    """
    best, fitted = MAX_REMAINDER, None
    for each in filtered:
        line = _line(angles[first:], each[first:])
        if line is not None and line[2] < best:
            best, fitted = line[2], line[0] + line[1] * each
    return fitted if fitted is not None and np.isfinite(fitted).all() else None


def _low_passes(commands: FloatArray) -> FloatArray:
    """Returns commands after low-pass filters of first order, ``(constants * motors, steps)``.

    Row k of a filter contains the commands up to row k - 1: command k has its effect after row k.
    """
    known = np.nan_to_num(held(np.where(np.isfinite(commands), commands, np.nan)))  # 0 at first
    gains = np.array(
        [1 - np.exp(-1 / constant) if constant else 1.0 for constant in TIME_CONSTANTS]
    )
    filtered = np.empty((len(known), len(gains), known.shape[1]))
    filtered[0] = known[0]
    for k in range(1, len(known)):
        filtered[k] = filtered[k - 1] + gains[:, np.newaxis] * (known[k - 1] - filtered[k - 1])
    return np.ascontiguousarray(filtered.reshape(len(known), -1).T)


def _line(values: FloatArray, over: FloatArray) -> tuple[float, float, float] | None:
    """Returns intercept, slope and the share of the variance that the line leaves."""
    known = np.isfinite(values) & np.isfinite(over)
    if known.sum() < MIN_KNOWN:
        return None
    y, x = values[known], over[known]
    mean, over_mean = y.mean(), x.mean()
    dy, dx = y - mean, x - over_mean
    variance, spread = float(np.square(dy).mean()), float(np.square(dx).mean())
    if min(variance, spread) < MIN_VARIANCE:
        return None
    slope = float((dx * dy).mean()) / spread
    left = float(np.square(dy - slope * dx).mean()) / variance
    return float(mean) - slope * float(over_mean), slope, left
