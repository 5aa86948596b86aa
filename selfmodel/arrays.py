"""Array types for signatures, and functions on arrays."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]


def frozen(values: FloatArray) -> FloatArray:
    """Returns ``values`` as a C-contiguous float64 read-only copy."""
    copy = np.array(values, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy


def columns(indices: list[int]) -> slice | list[int]:
    """Returns an index of array columns: a slice where they are contiguous, to avoid a copy."""
    first = indices[0] if indices else 0
    if indices == list(range(first, first + len(indices))):
        return slice(first, first + len(indices))
    return indices
