"""Breaches of the contracts of plug-ins, as errors that name the rule."""

from collections.abc import Callable
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError


class ContractError(ValueError):
    """A plug-in breaks a rule of its contract, which the message names."""


def require(holds: object, breach: str) -> None:
    """Raises ``ContractError`` unless a rule holds."""
    if not holds:
        raise ContractError(breach)


def require_alone(what: str, alone: FloatArray, together: FloatArray) -> None:
    """Raises ``ContractError`` unless a run has the same values alone and in a batch."""
    if not np.array_equal(alone, together, equal_nan=True):
        difference = np.nanmax(np.abs(alone - together), initial=0)
        raise ContractError(
            f"the {what} must not depend on the other runs, to the last bit: alone and in a batch "
            f"they differ by up to {difference:.3g}. It may use a number of the batch, such as its "
            f"mean or size, or sums in numpy's memory order: try np.ascontiguousarray before a sum"
        )


def called(what: str, method: Callable[[Any], Any], given: object) -> Any:  # noqa: ANN401
    """Returns what a method of a plug-in returns; its errors are breaches of the contract."""
    try:
        return method(given)
    except InputError:
        raise
    except Exception as error:  # a plug-in may raise any exception
        raise ContractError(f"{what} raised {type(error).__name__}: {error}: correct it") from error
