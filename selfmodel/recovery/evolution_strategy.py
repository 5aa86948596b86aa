"""An evolution strategy with antithetic pairs and ranks: a search over many weights.

Source: Salimans et al., *Evolution strategies as a scalable alternative to reinforcement learning*
(arXiv:1703.03864): the gradient of the mean fitness of a normal distribution, estimated from pairs
of opposite genomes and the ranks of their fitness, and followed by Adam.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import draw_genomes
from selfmodel.evolution import check_fitness, first_generation
from selfmodel.settings import Settings

DEVIATION, RATE = 0.1, 0.05
"""Standard deviation of the genomes of a generation about their mean, and step of that mean; the
values of a genome are in [-1, 1]."""

DECAYS, SMALL = (0.9, 0.999), 1e-8
"""Decays of Adam's moments, and what its denominator is at least (arXiv:1412.6980)."""


class EvolutionStrategy:
    """An evolution strategy, a ``GenomeSearch``; fitness is maximised.

    Args:
        length, settings, rng, seeds: As of ``Evolution``.
        start: Mean of the first generation; None for the best genome of a generation before it, of
            the seeds and random genomes.
        pairs: Pairs of opposite genomes of a generation; None for a population of the settings.
        deviation: Standard deviation of the genomes about the mean.
        rate: Largest step of the mean, per value.
    """

    def __init__(
        self,
        length: int,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
        *,
        start: FloatArray | None = None,
        pairs: int | None = None,
        deviation: float = DEVIATION,
        rate: float = RATE,
    ) -> None:
        self._rng, self._deviation, self._rate = rng, deviation, rate
        self._pairs = pairs or max(1, settings.population // 2)
        self._moments = np.zeros((2, length))
        self._updates = 0  # of the mean
        self.generation = 0
        self.evaluations = 0
        self._asked = np.empty((0, length))
        self._noise = np.empty((0, length))
        self.mean = np.zeros(length) if start is None else np.array(start)
        if start is None:
            size = max(2 * self._pairs, len(seeds))
            self._asked = first_generation(size, length, draw_genomes, rng, seeds)

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(2 * pairs, length)``: one half, then its opposites.

        Without a start, the first ones are the seeds and random ones.

        A generation is drawn when it is first asked for: the random numbers up to a ``tell`` do not
        depend on the next generation.
        """
        if not len(self._asked):
            self._noise = self._rng.standard_normal((self._pairs, len(self.mean)))
            change = self._deviation * self._noise
            self._asked = np.clip(np.concatenate([self.mean + change, self.mean - change]), -1, 1)
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``, none of them NaN."""
        check_fitness(fitness, self._asked)
        best = np.argsort(-fitness, kind="stable")
        self._best, self._asked = self._asked[best], self._asked[:0]
        self.generation += 1
        self.evaluations += len(fitness)
        if not len(self._noise):
            self.mean = self._best[0]
            return
        self._updates += 1
        ranks = np.empty(len(fitness))
        ranks[np.argsort(fitness, kind="stable")] = np.arange(len(fitness)) / (len(fitness) - 1)
        better = ranks[: self._pairs] - ranks[self._pairs :]
        # einsum sums in one order; the products of BLAS depend on its threads.
        slope = np.einsum("p,pl->l", better, self._noise) / (2 * self._pairs)
        decays = np.array(DECAYS)[:, np.newaxis]
        self._moments = decays * self._moments + (1 - decays) * np.array([slope, slope**2])
        first, second = self._moments / (1 - decays**self._updates)
        self.mean = np.clip(self.mean + self._rate * first / (np.sqrt(second) + SMALL), -1, 1)

    def candidates(self, count: int) -> FloatArray:
        """Returns the mean, and the best genomes of the last generation."""
        return np.concatenate([self.mean[np.newaxis], self._best])[:count]

    def state(self) -> Mapping[str, FloatArray]:
        """Returns what determines the next generations besides the generator, after a ``tell``."""
        counts = np.array([self.generation, self.evaluations, self._updates], dtype=np.float64)
        return {"mean": self.mean, "moments": self._moments, "counts": counts}

    def resume(self, state: Mapping[str, FloatArray]) -> None:
        """Continues from a ``state``."""
        self.mean, self._moments = state["mean"], np.array(state["moments"])
        self.generation, self.evaluations, self._updates = map(int, state["counts"])
        self._asked = np.empty((0, len(self.mean)))
