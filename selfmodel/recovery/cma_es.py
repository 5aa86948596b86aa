"""CMA-ES with raced starts: a search over genomes whose fitness is noisy.

Source: Hansen, *The CMA evolution strategy: a tutorial* (arXiv:1604.00772); the implementation is
that of the library ``cma``.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import draw_genomes
from selfmodel.evolution import Draw, check_fitness, first_generation
from selfmodel.settings import Settings

DEVIATION = 0.4
"""Standard deviation of the first generation of a run from a random genome; genomes are in
[-1, 1]."""

SEED_DEVIATION = 0.15
"""Standard deviation of the first generation of a run from a seed: a larger one forgets it."""

SHARE = 0.12
"""Genomes of a generation of a run, relative to the population of the paper's EA."""

RANDOM_SHARE = 2.0
"""Random genomes from which the runs start, relative to that population."""

MIN_POPULATION = 4
"""Smallest generation of a run, of which the better half is recombined."""

STARTS = 4
"""Number of runs that start, at most half of them from seeds. One single start in three converges
to a poor gait, so that two go on to the end."""

PRUNED_AFTER = 8
"""Generations after which the better half of the runs continues."""

RECENT = 5
"""Generations whose fitness counts in that choice, and whose genomes are ``candidates``."""


class CmaEs:
    """Raced runs of CMA-ES, a ``GenomeSearch``; fitness is maximised.

    The first generation contains the seeds and random genomes. The best of them are the initial
    means of the runs, of which the better half continues after some generations.
    The covariance is diagonal (sep-CMA-ES; Ros and Hansen, PPSN 2008): it adapts within
    the evaluations that a repair affords.

    Args:
        length, settings, rng, seeds, draw: As of ``Evolution``; all seeds are used.
        random: Random genomes of the first generation, besides the seeds; None for a share of the
            EA's population, seeds included.
        deviation: Standard deviation of the first generation of a run from a random genome.
        seed_deviation: Likewise from a seed.
        starts: Number of runs that start.
        population: Genomes of a generation of a run; None for a share of the EA's population.
    """

    def __init__(
        self,
        length: int,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
        *,
        draw: Draw = draw_genomes,
        random: int | None = None,
        deviation: float = DEVIATION,
        seed_deviation: float = SEED_DEVIATION,
        starts: int = STARTS,
        population: int | None = None,
    ) -> None:
        self._rng, self._deviations, self._seeds = rng, (seed_deviation, deviation), len(seeds)
        self._starts = starts
        self._population = population or max(MIN_POPULATION, round(SHARE * settings.population))
        if random is None:
            random = round(RANDOM_SHARE * settings.population) - len(seeds)
        size = max(starts, random) + len(seeds)
        self._asked = first_generation(size, length, draw, rng, seeds)
        self._runs: list[_Run] = []
        self.generation = 0
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``: random ones, then those of the runs."""
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``, none of them NaN."""
        check_fitness(fitness, self._asked)
        if not self._runs:
            self._runs = self._started(fitness)
        else:
            # A diverged simulation is worse than all others by a finite number.
            worst = np.min(fitness, where=np.isfinite(fitness), initial=np.inf) - 1.0
            bounded = np.where(np.isfinite(fitness), fitness, worst if worst < np.inf else 0.0)
            parts = (np.split(values, len(self._runs)) for values in (fitness, bounded))
            for run, *values in zip(self._runs, *parts, strict=True):
                run.tell(*values)
            if self.generation == PRUNED_AFTER:
                order = sorted(self._runs, key=lambda run: -run.recent_fitness)
                self._runs = order[: max(1, len(order) // 2)]
        self.generation += 1
        self.evaluations += len(fitness)
        self._asked = np.concatenate([run.ask() for run in self._runs])

    def _started(self, fitness: FloatArray) -> list["_Run"]:
        """Returns the runs from the best seeds and the best random genomes."""
        order = np.argsort(-fitness, kind="stable")
        seeds = order[order < self._seeds][: max(1, self._starts // 2)]
        random = order[order >= self._seeds][: self._starts - len(seeds)]
        of_seed, of_random = self._deviations
        starts = [(i, of_seed) for i in seeds] + [(i, of_random) for i in random]
        return [
            _Run(self._asked[i], deviation, self._population, self._rng) for i, deviation in starts
        ]

    def candidates(self, count: int) -> FloatArray:
        """Returns genomes that may be the best, ``(count or fewer, length)``.

        They are the means of the runs and the best genomes of recent generations: with a noisy
        fitness the highest value seen is an overestimate, and the mean of a run is often better
        than any genome evaluated.
        """
        recent = [best for run in self._runs for best in run.recent]
        genomes = [genome for _, genome in sorted(recent, key=lambda best: -best[0])]
        return np.array([*(run.mean for run in self._runs), *genomes][:count])


class _Run:
    """One run of CMA-ES from an initial mean, with a deviation and a size of its generations."""

    def __init__(
        self, start: FloatArray, deviation: float, population: int, rng: np.random.Generator
    ) -> None:
        import cma  # noqa: PLC0415  # slow to import: it loads pyplot and scipy.stats

        options: dict[str, Any] = {
            "bounds": [-1, 1],
            "popsize": population,
            "CMA_diagonal": True,
            "randn": lambda *shape: rng.standard_normal(shape),
            "seed": np.nan,  # the library's own generator is not used
            "verbose": -9,
        }
        # The bounds' transformation is not invertible at the bounds.
        self._search = cma.CMAEvolutionStrategy(np.clip(start, -0.99, 0.99), deviation, options)
        self.recent: list[tuple[float, FloatArray]] = []
        self._best_halves: list[float] = []

    @property
    def mean(self) -> FloatArray:
        """Mean of the distribution, ``(length,)``."""
        return _bounded(self._search.result.xfavorite)

    @property
    def recent_fitness(self) -> float:
        """Mean fitness of the better half of recent generations."""
        return float(np.mean(self._best_halves[-RECENT:]))

    def ask(self) -> FloatArray:
        self._genomes = _bounded(np.array(self._search.ask()))
        return self._genomes

    def tell(self, fitness: FloatArray, finite: FloatArray) -> None:
        self._search.tell(list(self._genomes), list(-finite))
        order = np.argsort(-fitness, kind="stable")
        self._best_halves.append(float(fitness[order[: len(order) // 2]].mean()))
        best = (float(fitness[order[0]]), self._genomes[order[0]])
        self.recent = [*self.recent, best][-RECENT:]


def _bounded(genomes: FloatArray) -> FloatArray:
    """Returns genomes without a rounding error beyond the bounds."""
    return np.clip(genomes, -1.0, 1.0)
