"""Differences of signals; orientations are compared as rotations."""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.rotation import directions, rotation_between
from selfmodel.trials.signals import Signal


def difference(signal: Signal, one: FloatArray, other: FloatArray) -> FloatArray:
    """Returns ``one - other`` for values of a signal: the rotation between orientations.

    Args:
        signal: Name of the signal.
        one: ``(..., width)``.
        other: ``(..., width)``, broadcastable to the shape of ``one``.

    Returns:
        ``(..., width)`` in the signal's unit; ``(..., 3)``, rad, for an orientation.
    """
    if signal == "base_orientation":
        return rotation_between(one, other)
    return np.asarray(one - other)


def comparable(signal: Signal, values: FloatArray) -> FloatArray:
    """Returns the columns of a signal in a form that may be averaged and subtracted.

    Args:
        signal: Name of the signal.
        values: ``(..., width)``.

    Returns:
        ``(..., columns)``: direction cosines for an orientation; otherwise the values.
    """
    return directions(values) if signal == "base_orientation" else values
