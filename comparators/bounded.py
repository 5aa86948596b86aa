"""The loss that no single outlier can dominate."""

from selfmodel.arrays import FloatArray


def bounded(residuals: FloatArray) -> FloatArray:
    """Returns u² / (1 + u²): the square of a small residual, 1 for a hopeless one.

    Source: Geman and McClure, "Statistical methods for tomographic image reconstruction", Bulletin
    of the International Statistical Institute 52 (1987).

    Args:
        residuals: In units of what counts as a large one, any shape.
    """
    squared = residuals * residuals
    return squared / (1 + squared)
