"""Geman-McClure loss: a robust loss, bounded by 1."""

from selfmodel.arrays import FloatArray


def bounded(residuals: FloatArray) -> FloatArray:
    """Returns the Geman-McClure loss u² / (1 + u²), which no single outlier can dominate.

    Source: Geman and McClure, "Statistical methods for tomographic image reconstruction", Bulletin
    of the International Statistical Institute 52 (1987).

    Args:
        residuals: Residuals over the size that counts as large, any shape.
    """
    squared = residuals * residuals
    return squared / (1 + squared)
