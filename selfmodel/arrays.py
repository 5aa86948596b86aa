"""The array types that signatures name."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]


def frozen(values: FloatArray) -> FloatArray:
    """Returns ``values`` as a C-contiguous float64 copy that refuses to be written."""
    copy = np.array(values, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy


def columns(indices: list[int]) -> slice | list[int]:
    """Returns what selects these columns of an array: a slice, which copies nothing, if it can."""
    first = indices[0] if indices else 0
    if indices == list(range(first, first + len(indices))):
        return slice(first, first + len(indices))
    return indices
