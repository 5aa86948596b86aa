"""The paper's EA for a noisy fitness, a ``GenomeSearch``."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.evolution import Draw, check_fitness, first_generation, offspring_of
from selfmodel.recovery.repair.genome_search import Rollouts
from selfmodel.settings import Settings


class NoisyEa:
    """The paper's EA, which evaluates its survivors again in each generation; it is maximised.

    A fitness under random conditions is comparable within a generation only, and the luck of
    a survivor must not last.

    Args:
        length: Number of values of a genome.
        draw: Draws the values of random genomes and of mutations.
        settings: Parameters of the search.
        rng: Source of all random numbers.
        seeds: Genomes of the first generation beside random genomes.
    """

    rollouts: ClassVar[Rollouts] = "whole"

    def __init__(
        self,
        length: int,
        draw: Draw,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> None:
        self._settings, self._draw, self._rng = settings, draw, rng
        self._asked = first_generation(settings.population, length, draw, rng, seeds)
        self._best = self._asked
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(population, length)``: survivors, then children."""
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(population,)``.

        Raises:
            ValueError: ``fitness`` has another shape, or a NaN.
        """
        check_fitness(fitness, self._asked)
        self._best = self._asked[np.argsort(-fitness, kind="stable")]
        self.evaluations += len(fitness)
        survivors = self._best[: self._settings.survivors]
        children = offspring_of(survivors, self._draw, self._settings, self._rng)
        self._asked = np.concatenate([survivors, children])

    def candidates(self, count: int) -> FloatArray:
        """Returns the best genomes of the last generation, best first, ``(count, length)``."""
        return self._best[:count]
