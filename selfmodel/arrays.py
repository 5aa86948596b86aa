"""Array types for signatures, functions on arrays, and arrays as a data frame."""

import importlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

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


def finite_or_none(value: float) -> float | None:
    """Returns a number as JSON has it: None for NaN and infinities, which it has not."""
    return value if math.isfinite(value) else None


def columns(indices: list[int]) -> slice | list[int]:
    """Returns an index of array columns: a slice where they are contiguous, to avoid a copy."""
    first = indices[0] if indices else 0
    if indices == list(range(first, first + len(indices))):
        return slice(first, first + len(indices))
    return indices


def mean_of_known(values: FloatArray, axis: int | tuple[int, ...], empty: float) -> FloatArray:
    """Returns the mean of the finite values over some axes; ``empty`` where there are none."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), empty)


def median_of_known(columns: FloatArray) -> FloatArray:
    """Returns the median of each column's finite values, ``(rows, columns)``; NaN without any."""
    known = (column[np.isfinite(column)] for column in columns.T)
    return np.array([np.median(own) if len(own) else np.nan for own in known], dtype=np.float64)


def held(values: FloatArray, axis: int = 0) -> FloatArray:
    """Returns an array with each NaN or infinity the last number before it along an axis.

    A first one remains.
    """
    rows = np.moveaxis(values, axis, -1)
    last = np.where(np.isfinite(rows), np.arange(rows.shape[-1]), 0)
    found = np.take_along_axis(rows, np.maximum.accumulate(last, axis=-1), axis=-1)
    return np.ascontiguousarray(np.moveaxis(found, -1, axis))


def data_frame(
    content: Sequence[Mapping[str, Any]] | Mapping[str, FloatArray | IndexArray],
) -> Any:  # noqa: ANN401  # pandas has no types
    """Returns a ``pandas.DataFrame`` of rows, with one column per key, or of columns by name."""
    return importlib.import_module("pandas").DataFrame(content)  # slow to import
