"""Correction of p values for their number."""

from collections.abc import Sequence

import numpy as np

from selfmodel.experiments.statistics.finite import finite


def holm(p_values: Sequence[float]) -> list[float]:
    """Returns p values adjusted by Holm's method, in the order given.

    The probability that any true hypothesis has an adjusted p below 0.05 is at most 0.05.

    Assumption: each p is valid by itself; the tests may depend on each other in any way.

    Source: S. Holm, *A simple sequentially rejective multiple test procedure*, Scandinavian Journal
    of Statistics 6 (1979).

    Raises:
        ValueError: A p value is NaN, or outside 0 to 1.
    """
    given = finite("p values", p_values)
    if np.any((given < 0) | (given > 1)):
        raise ValueError(f"expected p values from 0 to 1, got {list(p_values)}")
    order = np.argsort(given, kind="stable")
    factors = len(p_values) - np.arange(len(p_values))
    steps = np.maximum.accumulate(given[order] * factors)
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.minimum(steps, 1.0)
    return [float(p) for p in adjusted]
