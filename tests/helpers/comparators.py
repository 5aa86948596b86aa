"""Prepared trials made of functions, for comparators of tests."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.diagnosis.comparator import Losses, PiecewiseTrial
from selfmodel.simulation.requests import Request
from selfmodel.trials.trajectory import Trajectory

Compare = Callable[[Trajectory], Any]


@dataclass(frozen=True)
class Prepared:
    """A prepared trial with one distance."""

    request: Request
    distances: Compare


@dataclass(frozen=True)
class PreparedPieces:
    """A prepared trial with losses."""

    request: Request
    losses: Compare


def distances_of(prepared: Any, simulated: Trajectory) -> np.ndarray:  # noqa: ANN401  # of any kind
    """Returns the distance of each simulation from a prepared trial, ``(n,)``."""
    if not isinstance(prepared, PiecewiseTrial):
        return np.asarray(prepared.distances(simulated))
    found = prepared.losses(simulated)
    return np.asarray((found.total if isinstance(found, Losses) else found).mean(axis=1))
