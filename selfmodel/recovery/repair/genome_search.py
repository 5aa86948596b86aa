"""The interface of searches over genomes under random conditions."""

from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.evolution import Draw
from selfmodel.settings import Settings

Rollouts = Literal["short", "whole"]
"""Rollouts of a generation: short ones of ``SHORT_STEPS``, as of a random sample, or whole ones."""


SHORT_STEPS = 200
"""Control steps of short rollouts."""


class GenomeSearch(Protocol):
    """Search over genomes; fitness is maximised. The budget of the caller ends it.

    Attributes:
        evaluations: Number of genomes evaluated so far.
    """

    evaluations: int

    @property
    def rollouts(self) -> Rollouts:
        """Rollouts that the generation needs."""
        ...

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``; the same ones until ``tell``."""
        ...

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``.

        Raises:
            ValueError: ``fitness`` has another shape, or a NaN.
        """
        ...

    def candidates(self, count: int) -> FloatArray:
        """Returns at most ``count`` genomes that may be the best, ``(n, length)``."""
        ...


MakeSearch = Callable[
    [int, Draw, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch
]
"""Function from the length of a genome, the distribution of random genomes, the settings, the
random number generator and initial genomes to a search."""
