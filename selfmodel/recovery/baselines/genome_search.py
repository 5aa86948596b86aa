"""CMA-ES, or the paper's EA, as the search of a baseline."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.recovery.baselines.problem import Fitness, Search
from selfmodel.recovery.robust_repair import MakeSearch
from selfmodel.settings import Settings

KEPT = 50
"""Number of controllers that a search returns."""


def genome_search(make_search: MakeSearch, settings: Settings) -> Search:
    """Returns the search of a baseline by a search over genomes.

    Args:
        make_search: Makes the search over genomes, such as ``CmaEs`` or ``NoisyEa``.
        settings: The paper's numbers.
    """
    return partial(_search, make_search=make_search, settings=settings)


def _search(
    design: Design,
    fitness: Fitness,
    evaluations: int,
    rng: np.random.Generator,
    *,
    make_search: MakeSearch,
    settings: Settings,
) -> Sequence[Controller]:
    search = make_search(design.weights, draw_genomes, settings, rng, ())
    known: dict[Controller, float] = {}

    def evaluated(genomes: FloatArray) -> FloatArray:
        controllers = [Controller(design, genome) for genome in genomes]
        scores = fitness(controllers)
        known.update(zip(controllers, scores.tolist(), strict=True))
        return scores

    while search.evaluations < evaluations:
        search.tell(evaluated(search.ask()))
    evaluated(search.candidates(KEPT))
    return sorted(known, key=lambda one: -known[one])[:KEPT]
