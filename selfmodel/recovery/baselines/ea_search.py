"""The paper's EA as the search of a baseline."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.evolution import Evolution, evolve
from selfmodel.recovery.baselines.problem import Fitness, Search
from selfmodel.settings import Settings

KEPT = 50
"""Number of controllers that a search returns."""


def ea_search(settings: Settings) -> Search:
    """Returns the search by the EA of the paper.

    Args:
        settings: Population and operators; the number of generations follows from the evaluations.
    """
    return partial(_search, settings)


def _search(
    settings: Settings,
    design: Design,
    fitness: Fitness,
    evaluations: int,
    rng: np.random.Generator,
) -> Sequence[Controller]:
    children = settings.population - settings.survivors
    search = Evolution(design.weights, draw_genomes, settings, rng)
    search.generations = 1 + max(0, -(-(evaluations - settings.population) // children))
    known: dict[Controller, float] = {}

    def evaluated(genomes: FloatArray) -> FloatArray:
        controllers = [Controller(design, genome) for genome in genomes]
        scores = fitness(controllers)
        known.update(zip(controllers, scores.tolist(), strict=True))
        return scores

    evolve(search, evaluated, lambda _generation: None)
    return sorted(known, key=lambda one: -known[one])[:KEPT]
