"""Search from the gaits of a repertoire, under the diagnosed hypothesis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.evolution import Draw
from selfmodel.recovery.repair.cma_es import SEED_DEVIATION, CmaEs
from selfmodel.recovery.repair.genome_search import SHORT_STEPS
from selfmodel.recovery.repertoire.repertoire import Repertoire
from selfmodel.settings import Settings

COST = 1 / 8
"""Control steps of the first generation, relative to those of the paper's repair EA."""


@dataclass(frozen=True, eq=False)
class FromRepertoire:
    """Makes CMA-ES whose runs begin from gaits of a repertoire; a ``MakeSearch``.

    A random sample of the gaits, over short rollouts, takes the place of random genomes. The best
    of them start the runs. Source of the idea: Cully et al., *Robots that can adapt like animals*
    (Nature 2015); here the gaits are evaluated under the diagnosed faults, which takes no
    physical trial.

    Attributes:
        repertoire: Gaits of the healthy robot, with controllers of the design that is searched.
    """

    repertoire: Repertoire

    def __call__(
        self,
        length: int,
        _draw: Draw,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> CmaEs:
        """Returns the search; see ``MakeSearch``."""
        longer = settings.steps / min(SHORT_STEPS, settings.steps)
        gaits = min(len(self.repertoire), round(COST * settings.evaluations * longer))
        share = (gaits + len(seeds)) / settings.population
        return CmaEs(
            length, self._drawn, settings, rng, seeds, share=share, deviation=SEED_DEVIATION
        )

    def _drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        """Returns random gaits, distinct if there are as many, ``(n, weights)``."""
        count, gaits = shape[0], len(self.repertoire)
        return self.repertoire.genomes[rng.choice(gaits, count, replace=count > gaits)]
