"""The paper's evolutionary algorithm, as ask / tell / stop; both EAs are this one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.settings import Settings

Draw = Callable[[np.random.Generator, tuple[int, ...]], FloatArray]
"""Draws values of a genome: ``(generator, shape) -> array of that shape``."""


@dataclass(frozen=True)
class Generation:
    """How far a search has come.

    Attributes:
        number: Generations evaluated.
        total: Generations there will be.
        best: Highest fitness so far.
        evaluations: Genomes evaluated so far.
        seconds: Since the search began.
    """

    number: int
    total: int
    best: float
    evaluations: int
    seconds: float


GenerationCallback = Callable[[Generation], None]
"""Is told of every generation; what it does with that is its own affair."""


class Evolution:
    """A population that is asked for genomes and told how fit they are; fitness is maximised.

    Half the population survives; the other half are children: each the winner of a tournament
    among the survivors, mutated, some of the pairs then crossed at one point. Source: the paper,
    section III.

    Args:
        length: Values of a genome.
        draw: Draws values, for new genomes and for mutations.
        settings: The numbers of the search.
        rng: Every random choice comes from it.
        seeds: Genomes to start from, beside random ones; those beyond the population are left out.
    """

    def __init__(
        self,
        length: int,
        draw: Draw,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> None:
        self._settings = settings
        self._draw = draw
        self._rng = rng
        known = list(seeds)[: settings.population]
        fresh = draw(rng, (settings.population - len(known), length))
        self._asked = np.concatenate([np.array(known).reshape(-1, length), fresh])
        self._genomes = np.empty((0, length))
        self._fitness = np.empty(0)
        self.generations = settings.generations
        self.generation = 0
        self.evaluations = 0

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``: everybody at first, then children."""
        return self._asked

    def tell(self, fitness: FloatArray) -> None:
        """Takes the fitness of the genomes last asked for, ``(n,)``, and breeds the next.

        Raises:
            ValueError: There is not one number for each genome, or one is not a number.
        """
        if fitness.shape != (len(self._asked),) or np.isnan(fitness).any():
            raise ValueError(
                f"expected a fitness for each of the {len(self._asked)} genomes asked for, "
                f"none of them NaN, got shape {fitness.shape}"
            )
        genomes = np.concatenate([self._genomes, self._asked])
        scores = np.concatenate([self._fitness, fitness])
        best = np.argsort(-scores, kind="stable")
        self.best, self.best_fitness = genomes[best[0]], float(scores[best[0]])
        survivors = best[: self._settings.survivors]
        self._genomes, self._fitness = genomes[survivors], scores[survivors]
        self.generation += 1
        self.evaluations += len(fitness)
        self._asked = self._children()

    def stop(self) -> dict[str, int]:
        """Returns why the search is over, such as ``{"generations": 30}``, or nothing."""
        if self.generation >= self.generations:
            return {"generations": self.generations}
        return {}

    def _children(self) -> FloatArray:
        settings, rng = self._settings, self._rng
        count = settings.population - settings.survivors
        # Survivors are sorted, so the winner of a tournament is its lowest index.
        entrants = rng.integers(len(self._genomes), size=(count, settings.tournament))
        return reproduce(self._genomes[entrants.min(axis=1)], self._draw, settings, rng)


def reproduce(
    parents: FloatArray, draw: Draw, settings: Settings, rng: np.random.Generator
) -> FloatArray:
    """Returns a child of each genome: mutated, and some of the pairs of neighbours then crossed.

    Args:
        parents: ``(n, length)``; they are not changed.
        draw: Draws values for mutations.
        settings: How often a value mutates and how many pairs cross.
        rng: Every random choice comes from it.
    """
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
    search: Evolution,
    fitness: Callable[[FloatArray], FloatArray],
    on_generation: GenerationCallback,
) -> None:
    """Runs a search to its end.

    Args:
        search: Where to start; afterwards its ``best`` is the best genome found.
        fitness: From genomes ``(n, length)`` to a fitness each ``(n,)``.
        on_generation: Is told of every generation.
    """
    start = perf_counter()
    while not search.stop():
        search.tell(fitness(search.ask()))
        on_generation(
            Generation(
                number=search.generation,
                total=search.generations,
                best=search.best_fitness,
                evaluations=search.evaluations,
                seconds=perf_counter() - start,
            )
        )
