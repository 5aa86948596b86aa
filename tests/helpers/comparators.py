"""Prepared trials made of functions, for comparators of tests."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from selfmodel.simulation.requests import Request
from selfmodel.trials.behaviour import Behaviour

Compare = Callable[[Behaviour], Any]


@dataclass(frozen=True)
class Prepared:
    """A prepared trial with one distance."""

    request: Request
    distances: Compare


@dataclass(frozen=True)
class PreparedPieces(Prepared):
    """A prepared trial with losses."""

    losses: Compare
