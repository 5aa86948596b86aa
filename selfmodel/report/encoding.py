"""Compact arrays in JSON: 16-bit numbers with a scale, in base64."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray

LEVELS = 65535
"""Largest 16-bit number."""


def quantised(values: FloatArray) -> dict[str, Any]:
    """Returns finite numbers as 16-bit numbers between the bounds of each column.

    Args:
        values: Numbers, ``(..., columns)``; the error is at most 1/131070 of a column's span.

    Returns:
        ``low`` and ``span`` of each column and, in ``data``, little-endian 16-bit numbers q in
        base64, in row-major order: a value is ``low + span * q / 65535``.
    """
    flat = values.reshape(-1, values.shape[-1])
    low, high = flat.min(axis=0), flat.max(axis=0)
    span = high - low
    levels = np.round((flat - low) / np.where(span > 0, span, 1.0) * LEVELS)
    return {
        "low": [float(one) for one in low],
        "span": [float(one) for one in span],
        "data": base64_of(levels.astype("<u2")),
    }


def base64_of(values: NDArray[Any]) -> str:
    """Returns the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
