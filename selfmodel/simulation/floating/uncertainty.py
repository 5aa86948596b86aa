"""Information of trials about parameters, without the noise of contacts."""

import numpy as np

from selfmodel.arrays import FloatArray

UNDETERMINED_SHARE = 0.7
"""Deviation of a parameter, relative to that of its prior, from which on the trials count as not
having determined it: they halve the variance of a parameter that they determine."""


def consistent_information(ahead: FloatArray, behind: FloatArray) -> FloatArray:
    """Returns the Fisher information on parameters, ``(parameters, parameters)``.

    A small change of a parameter changes the times of contacts, and with them the residuals at
    random. The square of one finite difference includes the square of this noise, which is no
    information: a parameter without influence would appear to be known. The noise of the forward
    and of the backward difference is independent, so their product does not include it. Negative
    eigenvalues are set to 0.

    Args:
        ahead: Forward differences of the residuals, ``(residuals, parameters)``.
        behind: Backward differences.
    """
    product = ahead.T @ behind
    values, vectors = np.linalg.eigh((product + product.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def determined(deviations: FloatArray, prior: FloatArray) -> tuple[bool, ...]:
    """Returns whether the trials determine each parameter.

    Args:
        deviations: Posterior standard deviations, ``(parameters,)``.
        prior: Standard deviations of the prior, ``(parameters,)``.
    """
    return tuple((deviations < UNDETERMINED_SHARE * prior).tolist())
