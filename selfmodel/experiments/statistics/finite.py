"""Check of numbers before they are tested: NaN would compare as no difference, or as a sure one."""

import math
from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray


def finite(what: str, values: Sequence[float]) -> FloatArray:
    """Returns numbers as an array.

    Args:
        what: Name of the numbers for the message.
        values: The numbers.

    Raises:
        ValueError: A number is NaN or infinite.
    """
    for place, value in enumerate(values):
        if not math.isfinite(value):
            raise ValueError(
                f"expected finite {what}, got {value} at place {place}: leave out runs without a "
                f"value"
            )
    return np.array(values, dtype=float)
