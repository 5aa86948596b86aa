"""Exact regression with a Gaussian process of zero mean and a Matérn 5/2 kernel."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.spatial import distance

from selfmodel.arrays import FloatArray


@dataclass(frozen=True)
class Kernel:
    """Matérn 5/2 kernel with a variance of 1, and the noise of the observations.

    Source: C. E. Rasmussen and C. K. I. Williams, *Gaussian Processes for Machine Learning* (2006),
    equation 4.17.

    Attributes:
        length_scale: Distance over which values are correlated, in the unit of the points.
        noise: Variance of the noise of an observation, relative to the variance of the process.
    """

    length_scale: float
    noise: float

    def __call__(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Returns the covariances of two sets of points, ``(n, d)`` and ``(m, d)``: ``(n, m)``."""
        scaled = np.sqrt(5.0) / self.length_scale * distance.cdist(one, other)
        return np.asarray((1 + scaled + np.square(scaled) / 3) * np.exp(-scaled))


def posterior(
    kernel: Kernel, points: FloatArray, values: FloatArray, queries: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns mean and standard deviation of the process at queries, given observations.

    Source: Rasmussen and Williams (2006), equations 2.25 and 2.26.

    Args:
        kernel: The kernel.
        points: Points of the observations, ``(n, d)``; n may be 0.
        values: Observations, ``(n,)``.
        queries: ``(m, d)``.

    Returns:
        ``(m,)`` each; without observations 0 and 1.
    """
    if not len(points):
        return np.zeros(len(queries)), np.ones(len(queries))
    factor = linalg.cho_factor(
        kernel(points, points) + kernel.noise * np.eye(len(points)), lower=True
    )
    across = kernel(queries, points)
    mean = across @ linalg.cho_solve(factor, values)
    explained = (across * linalg.cho_solve(factor, across.T).T).sum(axis=1)
    return np.asarray(mean), np.sqrt(np.maximum(0.0, 1 - explained))
