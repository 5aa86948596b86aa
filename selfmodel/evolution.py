"""The generational EA of the paper, and the loop that runs any search over genomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import counted
from selfmodel.progress import time_left
from selfmodel.settings import Settings

Draw = Callable[[np.random.Generator, tuple[int, ...]], FloatArray]
"""Function that draws values of genomes: ``(generator, shape) -> array of that shape``."""


@dataclass(frozen=True)
class Generation:
    """Progress of a search, whose text is a line with the evaluations and the time left.

    Attributes:
        number: Generations evaluated so far; those of searches differ in size.
        total: Generations of the whole search.
        best: Highest fitness so far; of the last generation if the fitness is noisy.
        evaluations: Genomes evaluated so far.
        seconds: Wall time since the start of the search.
    """

    number: int
    total: int
    best: float
    evaluations: int
    seconds: float

    def __str__(self) -> str:
        share = self.number / self.total
        left = time_left(share, self.seconds) if share < 1 else ""
        return ", ".join(filter(None, (counted(self.evaluations, "evaluation"), self.detail, left)))

    @property
    def detail(self) -> str:
        """The best fitness and the rate as text."""
        diverged = self.best == -np.inf
        best = "every simulation diverged" if diverged else f"best {self.best:.4f}"
        return (
            f"{best}, {self.evaluations / self.seconds:.0f}/s" if self.seconds else f"{best}, -/s"
        )


GenerationCallback = Callable[[Generation], None]


class GenomeSearch(Protocol):
    """Search over genomes; fitness is maximised. ``evolve`` runs it.

    Attributes:
        evaluations: Number of genomes evaluated so far.
    """

    evaluations: int

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``; the same ones until ``tell``."""
        ...

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``."""
        ...

    def candidates(self, count: int) -> FloatArray:
        """Returns at most ``count`` genomes that may be the best, ``(n, length)``."""
        ...


class Evolution:
    """Generational EA, a ``GenomeSearch``; fitness is maximised.

    The best half of the population survives. The other half are children: copies of tournament
    winners among the survivors, mutated, some pairs with one-point crossover. Source: the paper,
    section III.

    Args:
        length: Number of values of a genome.
        settings: Parameters of the search.
        rng: Source of all random numbers.
        seeds: Genomes of the first generation beside random genomes; the first
            ``settings.population`` seeds are used.
        draw: Draws the values of random genomes and of mutations.
        noisy: Whether fitness is comparable within a generation only: survivors are evaluated
            again with their children, so that the luck of one does not last.
    """

    def __init__(
        self,
        length: int,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
        *,
        draw: Draw,
        noisy: bool = False,
    ) -> None:
        self._settings, self._draw, self._rng, self._noisy = settings, draw, rng, noisy
        self._asked = first_generation(settings.population, length, draw, rng, seeds)
        self._genomes, self._fitness = np.empty((0, length)), np.empty(0)
        self.generation = 0
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``: first the population, then children."""
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``, and generates children.

        Raises:
            ValueError: ``fitness`` has another shape, or a NaN.
        """
        check_fitness(fitness, self._asked)
        kept = 0 if self._noisy else self._settings.survivors
        genomes = np.concatenate([self._genomes[:kept], self._asked])
        scores = np.concatenate([self._fitness[:kept], fitness])
        best = np.argsort(-scores, kind="stable")
        self._genomes, self._fitness = genomes[best], scores[best]
        self.best, self.best_fitness = self._genomes[0], float(self._fitness[0])
        self.generation += 1
        self.evaluations += len(fitness)
        survivors, _ = self.survivors
        children = offspring_of(survivors, self._draw, self._settings, self._rng)
        self._asked = np.concatenate([survivors, children]) if self._noisy else children

    @property
    def survivors(self) -> tuple[FloatArray, FloatArray]:
        """The genomes that survive, ``(n, length)``, best first, and their fitness, ``(n,)``."""
        count = self._settings.survivors
        return self._genomes[:count], self._fitness[:count]

    def candidates(self, count: int) -> FloatArray:
        """Returns at most ``count`` of the best genomes, best first, ``(n, length)``."""
        return self._genomes[:count]

    def generations_left(self) -> int:
        """Returns the number of generations that remain."""
        return self._settings.generations - self.generation


def first_generation(
    size: int, length: int, draw: Draw, rng: np.random.Generator, seeds: Sequence[FloatArray]
) -> FloatArray:
    """Returns seeds, then random genomes, ``(size, length)``; no more than ``size`` seeds."""
    known = list(seeds)[:size]
    fresh = draw(rng, (size - len(known), length))
    return np.concatenate([np.array(known).reshape(-1, length), fresh])


def check_fitness(fitness: FloatArray, genomes: FloatArray) -> None:
    """Raises ``ValueError`` unless there is a fitness, ``(n,)``, for each genome."""
    if fitness.shape != (len(genomes),) or np.isnan(fitness).any():
        raise ValueError(
            f"expected a fitness other than NaN for each of the {len(genomes)} genomes asked for, "
            f"got shape {fitness.shape}"
        )


def offspring_of(
    survivors: FloatArray, draw: Draw, settings: Settings, rng: np.random.Generator
) -> FloatArray:
    """Returns the children of survivors, best first, ``(children, length)``."""
    count = settings.population - settings.survivors
    # The entrant with the lowest index, which is the best one, wins a tournament.
    entrants = rng.integers(len(survivors), size=(count, settings.tournament))
    return reproduce(survivors[entrants.min(axis=1)], draw, settings, rng)


def reproduce(
    parents: FloatArray, draw: Draw, settings: Settings, rng: np.random.Generator
) -> FloatArray:
    """Returns one child per parent: mutated, then some adjacent pairs with one-point crossover."""
    mutated = rng.random(parents.shape) < settings.mutation
    children = np.where(mutated, draw(rng, parents.shape), parents)
    for pair in rng.permutation(len(children) // 2)[: settings.crossovers]:
        first, second = 2 * pair, 2 * pair + 1
        point = rng.integers(1, children.shape[1])
        tail = children[first, point:].copy()
        children[first, point:] = children[second, point:]
        children[second, point:] = tail
    return children


def evolve(
    search: GenomeSearch,
    fitness: Callable[[FloatArray], FloatArray],
    on_generation: GenerationCallback,
    generations_left: Callable[[], int],
    *,
    noisy: bool = False,
) -> None:
    """Runs a search until no generation is left, at least one.

    Args:
        search: The search.
        fitness: Fitness function, from genomes ``(n, length)`` to ``(n,)``.
        on_generation: Called after each generation.
        generations_left: Returns the number of generations that remain.
        noisy: Whether fitness is comparable within a generation only.
    """
    start, number, best, left = perf_counter(), 0, -np.inf, 1
    while left:
        values = fitness(search.ask())
        search.tell(values)
        best = float(values.max() if noisy else max(best, values.max()))
        number, left = number + 1, generations_left()
        seconds = perf_counter() - start
        on_generation(Generation(number, number + left, best, search.evaluations, seconds))
