"""Loss on the motion of joint encoders: the log against a hypothesis, at the encoder's noise.

An encoder that moves is evidence against a jam, one that stands while its joint is commanded is
evidence for a jam. The error of a predicted angle contains little of either: its scale allows for a
reality gap, and is larger than the motion of many a joint.
"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.comparators.loose_encoders import detached_hinges, stands
from selfmodel.simulation.requests import END
from selfmodel.trials.estimation import standing_tolerance

ERROR_SCALE = 0.5
"""Error of the natural logarithm of a motion that counts as large: a factor of 1.6."""

MIN_ROWS = 4
"""Known angles of a hinge that a segment needs for its motion."""


@dataclass(frozen=True, eq=False)
class LoggedMotion:
    """Motion of the encoders in the segments of a trial.

    The motion is a mean square deviation, rad^2; NaN without enough known angles.

    Attributes:
        within: Motion around the mean of the segment, ``(segments, hinges)``.
        overall: Motion in the segment around the median of the trial's end, ``(segments, hinges)``.
        tolerance: Motion that counts as none, ``(hinges,)``: both motions that are compared are
            increased by it, so that the noise of the log alone is a small error.
        known: Mask of the known angles, ``(segments, horizon + 1, hinges)``.
        resting: Angle at which a detached hinge is predicted, ``(hinges,)``.
    """

    within: FloatArray
    overall: FloatArray
    tolerance: FloatArray
    known: BoolArray
    resting: FloatArray


def logged_motion(
    positions: FloatArray, starts: IndexArray, horizon: int, resting: FloatArray
) -> LoggedMotion:
    """Returns the motion of the encoders in the segments of a trial.

    Args:
        positions: Logged joint positions, ``(steps, hinges)`` rad; NaN where unknown.
        starts: Step at which each segment begins, ``(segments,)``.
        horizon: Control steps of a segment.
        resting: Angle at which a detached hinge is predicted, ``(hinges,)`` rad.
    """
    angles = np.where(np.isfinite(positions), positions, np.nan)
    rows = angles[starts[:, np.newaxis] + np.arange(horizon + 1)]
    known = np.isfinite(rows)
    return LoggedMotion(
        within=_motion(rows, known),
        overall=_mean(np.square(rows - _median(angles[round((1 - END) * len(angles)) :])), known),
        tolerance=np.square(standing_tolerance(angles)),
        known=known,
        resting=resting,
    )


def encoder_motion_loss(predicted: FloatArray, logged: LoggedMotion) -> FloatArray:
    """Returns the loss of the predicted motion of the encoders, ``(n, segments)``.

    The error of a hinge is half the logarithm of the ratio of two mean square deviations, of the
    log and of the prediction, each increased by the tolerance. It is 0 for equal motions, and grows
    with the logarithm of their ratio. A welded hinge is predicted to stand at one angle during the
    whole trial, so the log's motion around the trial's median counts; for other hinges, that around
    the segment's mean. The encoder of a detached hinge contains no information: it may freeze, fail
    or follow its motor.

    Args:
        predicted: Predicted joint positions, ``(n, segments, horizon + 1, hinges)`` rad.
        logged: The motion in the log.

    Returns:
        The mean over the informative hinges of ``log(1 + (e / ERROR_SCALE)^2)``; 0 without any.
    """
    frozen, detached = stands(predicted), detached_hinges(predicted, logged.resting)
    motion = np.where(frozen[:, np.newaxis], logged.overall, logged.within)
    ratio = (motion + logged.tolerance) / (_motion(predicted, logged.known) + logged.tolerance)
    losses = np.log1p(np.square(0.5 * np.log(ratio) / ERROR_SCALE))
    informative = np.isfinite(motion) & ~detached[:, np.newaxis]
    total = np.where(informative, losses, 0.0).sum(axis=-1)
    return np.asarray(total / np.maximum(informative.sum(axis=-1), 1))


def _motion(angles: FloatArray, known: BoolArray) -> FloatArray:
    """Returns the mean square deviation from the mean over the rows, ``(..., segments, hinges)``.

    Args:
        angles: ``(..., segments, rows, hinges)``.
        known: Mask of the rows that count, ``(segments, rows, hinges)``.
    """
    mean = _mean(angles, known)[..., np.newaxis, :]
    return _mean(np.square(angles - mean), known)


def _mean(values: FloatArray, known: BoolArray) -> FloatArray:
    """Returns the mean over the known rows; NaN for fewer than ``MIN_ROWS``."""
    count = known.sum(axis=-2)
    total = np.where(known, values, 0.0).sum(axis=-2)
    return np.where(count >= MIN_ROWS, total / np.maximum(count, 1), np.nan)


def _median(angles: FloatArray) -> FloatArray:
    """Returns the median of the known angles of each hinge, ``(hinges,)``; NaN without any."""
    columns = (column[np.isfinite(column)] for column in angles.T)
    return np.array([np.median(one) if len(one) else np.nan for one in columns], dtype=np.float64)
