"""The paper's EA for a noisy fitness, with the interface ``ask``, ``tell``, ``stop``."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.evolution import Draw, reproduce
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

    groups = 0

    def __init__(
        self,
        length: int,
        draw: Draw,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> None:
        self._settings, self._draw, self._rng = settings, draw, rng
        known = list(seeds)[: settings.population]
        fresh = draw(rng, (settings.population - len(known), length))
        self._asked = np.concatenate([np.array(known).reshape(-1, length), fresh])
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
        if fitness.shape != (len(self._asked),) or np.isnan(fitness).any():
            raise ValueError(
                f"expected a fitness other than NaN for each of the {len(self._asked)} genomes "
                f"asked for, got shape {fitness.shape}"
            )
        settings, rng = self._settings, self._rng
        self._best = self._asked[np.argsort(-fitness, kind="stable")]
        self.evaluations += len(fitness)
        survivors = self._best[: settings.survivors]
        count = settings.population - settings.survivors
        entrants = rng.integers(len(survivors), size=(count, settings.tournament))
        children = reproduce(survivors[entrants.min(axis=1)], self._draw, settings, rng)
        self._asked = np.concatenate([survivors, children])

    def stop(self) -> dict[str, int]:
        """Returns no reason: the caller's budget ends the search."""
        return {}

    def candidates(self, count: int) -> FloatArray:
        """Returns the best genomes of the last generation, best first, ``(count, length)``."""
        return self._best[:count]
