"""Loss of each hinge on its own: the error of its short prediction, at the scale of its encoder.

A fault of one joint changes the motion of that joint far more than anything else. In the mean over
all hinges, and beside the contacts of the feet, little of it is left.
"""

from collections.abc import Mapping

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.trials.signals import HINGE_ERROR_SCALES, Signal


def hinge_losses(
    predicted: Mapping[Signal, FloatArray],
    logged: Mapping[Signal, FloatArray],
    compared: IndexArray,
) -> FloatArray:
    """Returns the loss of each hinge in each segment, ``(n, segments, hinges)``.

    The loss is the mean of ``log(1 + (e / s)^2)`` over the compared steps, of the angle plus of the
    velocity. It is NaN where the angle is unknown.

    Args:
        predicted: Predicted signals of ``n`` hypotheses, ``(n, segments, horizon + 1, width)``.
        logged: Logged state at the compared steps, ``(segments, comparisons, width)`` per signal.
        compared: Steps within a segment at which the state is compared, ``(comparisons,)``.
    """
    positions = predicted["joint_positions"]
    total = np.zeros((*positions.shape[:2], positions.shape[-1]))
    for signal, scale in HINGE_ERROR_SCALES.items():
        if signal in logged:
            errors = (predicted[signal][:, :, compared] - logged[signal]) / scale
            unknown = np.nan if signal == "joint_positions" else 0.0
            total += _mean_over_known(np.log1p(np.square(errors)), unknown)
    return total


def _mean_over_known(losses: FloatArray, unknown: float) -> FloatArray:
    """Returns the mean over the compared steps, ``(n, segments, hinges)``; ``unknown`` if none is.

    Args:
        losses: ``(n, segments, comparisons, hinges)``.
        unknown: Value where no step is known.
    """
    known = np.isfinite(losses)
    count = known.sum(axis=2)
    total = np.where(known, losses, 0.0).sum(axis=2)
    return np.where(count > 0, total / np.maximum(count, 1), unknown)
