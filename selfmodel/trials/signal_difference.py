"""Signals made comparable: all but the orientation are what they are, column by column."""

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.trials.behaviour import Signal
from selfmodel.trials.rotation import directions, rotation_between


def difference(signal: Signal, one: FloatArray, other: FloatArray) -> FloatArray:
    """Returns by how much values of a signal differ; of orientations, the rotation between them.

    Args:
        signal: What the values are of.
        one: ``(..., width)``.
        other: ``(..., width)``, of a shape that broadcasts to that of ``one``.

    Returns:
        ``(..., width)``, but ``(..., 3)`` of an orientation; in the signal's unit, rad.
    """
    if signal == "base_orientation":
        return rotation_between(one, other)
    return np.asarray(one - other)


def comparable(signal: Signal, values: FloatArray) -> FloatArray:
    """Returns columns of a signal that may be averaged and subtracted one by one.

    Args:
        signal: What the values are of.
        values: ``(..., width)``.

    Returns:
        ``(..., columns)``: of an orientation, where it points; otherwise the values.
    """
    return directions(values) if signal == "base_orientation" else values
