"""Logged joint efforts against a hypothesis: what the motors exert, and not only what moves.

The torque of a servo follows from the angle, the command and the strength of the motor, so that
measured torques show a weak motor directly, and a load by what it takes to carry it. Torques at
impacts are large and short: means over the steps between two comparisons are compared.

Torques grow with the size of a robot, and drivers report them as N m, as currents or as raw
numbers. So both the scale of an error and the unit are learned from healthy trials, for each hinge:
the unit is the factor of least squares between log and prediction. A hinge whose log is not
proportional to the prediction has no term: its log contains something else.
"""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray, mean_of_known, median_of_known

ERRORS, MIN_SCALE = 3.0, 0.1
"""Scale of the error of a mean torque, in median errors of the hinge in healthy trials: scales of
the state are about three times those of calibration too. And at least, relative to the root mean
square of its torques. At a fixed 0.2, torques were four times the rest of the loss of a healthy
robot of another generator, whose commands were late by 16 to 24 ms."""

MIN_PROPORTIONALITY = 0.8
"""Smallest cosine between log and prediction of a hinge in healthy trials at which the log is a
torque. Over all hinges together, the correlation was 0.92 to 0.99 in six healthy trials of
quadruped and hexapod with a reality gap of 0.1; noise has about 0."""


@dataclass(frozen=True)
class EffortScales:
    """The unit and the scale of each hinge's efforts; both NaN for a hinge without a term.

    Attributes:
        units: Number in the log per N m of the self-model.
        scales: Error that counts as large, N m.
    """

    units: tuple[float, ...]
    scales: tuple[float, ...]


def learned_scales(logged: FloatArray, predicted: FloatArray) -> EffortScales:
    """Returns the scales of mean efforts of healthy trials, ``(windows, hinges)`` each.

    Those of the log are NaN where they are unknown.
    """
    known = np.isfinite(logged)
    log, torque = np.where(known, logged, 0.0), np.where(known, predicted, 0.0)
    product, squares = (log * torque).sum(axis=0), np.square(torque).sum(axis=0)
    both = np.sqrt(squares * np.square(log).sum(axis=0))
    is_torque = (both > 0) & (np.abs(product) >= MIN_PROPORTIONALITY * both)
    with np.errstate(divide="ignore", invalid="ignore"):
        units = np.where(is_torque, product / squares, np.nan)
        least = MIN_SCALE * np.sqrt(squares / known.sum(axis=0))
    usual = ERRORS * median_of_known(np.abs(logged / units - predicted))
    scales = np.where(is_torque, np.maximum(usual, least), np.nan)
    return EffortScales(tuple(units.tolist()), tuple(scales.tolist()))


def mean_efforts(efforts: FloatArray, compared: IndexArray) -> FloatArray:
    """Returns the mean efforts since the compared step before, ``(..., comparisons, hinges)``.

    Args:
        efforts: Efforts in segments, ``(..., horizon + 1, hinges)``. Those of the first row are of
            the step before the segment, and left out.
        compared: Compared steps in a segment, ``(comparisons,)``; the last is its end.
    """
    begins = np.concatenate([[0], compared[:-1]])
    widths = (compared - begins)[:, np.newaxis]
    return np.asarray(np.add.reduceat(efforts[..., 1:, :], begins, axis=-2) / widths)


def effort_loss(
    predicted: FloatArray, logged: FloatArray, scales: EffortScales, detached: BoolArray
) -> FloatArray:
    """Returns the loss of the predicted torques, ``(n, segments)``; 0 without a known one.

    The motor of a detached limb may run or not, so that its torque is no evidence.

    Args:
        predicted: Mean efforts, ``(n, segments, comparisons, hinges)`` N m.
        logged: Mean efforts in the log, ``(segments, comparisons, hinges)``; NaN if unknown.
        scales: Units and scales of the hinges.
        detached: Mask of the hinges of detached limbs, ``(n, hinges)``.
    """
    error = (predicted - logged / np.array(scales.units)) / np.array(scales.scales)
    losses = np.where(detached[:, np.newaxis, np.newaxis], np.nan, np.log1p(np.square(error)))
    return mean_of_known(losses, axis=(-2, -1), empty=0.0)
