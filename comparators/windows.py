"""Windows of time series, and means over what was observed."""

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray

EVERYTHING: BoolArray = np.array(True)
"""A mask that contains all values."""


def padded_windows(
    values: FloatArray | BoolArray, length: int, observed: BoolArray = EVERYTHING
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
    np.copyto(padded[..., :steps, :], values, where=observed)
    return padded.reshape(*batch, windows, length, columns)


def masked_mean(values: FloatArray, mask: BoolArray) -> FloatArray:
    """Returns the mean over the last axis of the values in a mask; 0 where the mask is empty.

    Args:
        values: Finite values, ``(..., columns)``.
        mask: Mask that broadcasts to ``values``.
    """
    count = np.maximum(mask.sum(axis=-1), 1)
    return np.asarray((values * mask).sum(axis=-1) / count)
