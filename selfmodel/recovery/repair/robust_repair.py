"""Robust repair: evolves controllers on rollouts under random conditions.

A gait that is evolved in one exact simulation depends on that simulation: on a physical robot it
loses most of its speed. Here every generation has new conditions: noise of the readings, initial
poses, parameters of the model and indistinguishable hypotheses. Source: Jakobi, Husbands
and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy transfer).
"""

import math
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Draw, Generation, GenerationCallback
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.repair.candidate_controller import CandidateController
from selfmodel.recovery.repair.cma_es import CmaEs
from selfmodel.recovery.repair.robust_fitness import RobustFitness, robust
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.settings import Settings
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.simulator import Simulator

COST = 2.0
"""Simulated control steps of a repair, relative to those of the paper's repair EA."""

FIRST_STEPS = 200
"""Control steps of the rollouts of the random first generation."""

FINALISTS, FINAL_CONDITIONS = 12, 4
"""Largest numbers of candidates of a search, and of conditions under which they are compared."""

JUDGED, JUDGED_CONDITIONS = 4, 16
"""Number of the best candidates of that comparison, and largest number of conditions under which
these are compared at last."""

JUDGING = 0.04
"""Cost of both comparisons relative to that of the repair, approximately."""


class GenomeSearch(Protocol):
    """Search over genomes; fitness is maximised."""

    evaluations: int

    def ask(self) -> FloatArray:
        """Returns the genomes to evaluate, ``(n, length)``; the same ones until ``tell``."""
        ...

    def tell(self, fitness: FloatArray) -> None:
        """Sets the fitness of the genomes that ``ask`` returned, ``(n,)``."""
        ...

    def stop(self) -> dict[str, int]:
        """Returns the stop reason; empty while the search runs."""
        ...

    def candidates(self, count: int) -> FloatArray:
        """Returns at most ``count`` genomes that may be the best, ``(n, length)``."""
        ...


MakeSearch = Callable[
    [int, Draw, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch
]
"""Function from the length of a genome, the distribution of random genomes, the settings, the
random number generator and initial genomes to a search."""


class RobustRepair:
    """Repair under uncertainty; a ``Repair``.

    Args:
        simulator: Self-model.
        settings: The paper's numbers; they set the cost of a repair.
        design: Design of the controllers to evolve.
        score: Fitness of a rollout.
        make_search: Makes the search.

    Attributes:
        evaluations: Number of controllers evaluated so far.
    """

    def __init__(
        self,
        simulator: Simulator,
        settings: Settings,
        design: Design,
        score: Score = UPRIGHT,
        make_search: MakeSearch = CmaEs,
    ) -> None:
        self._simulator, self._settings, self._design = simulator, settings, design
        self._score, self._make_search = score, make_search
        self.evaluations = 0

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], Uncertainty],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns candidates, best first; see ``Repair``.

        Raises:
            WorkError: The simulation diverged with every controller.
        """
        design, settings, steps = self._design, self._settings, self._settings.steps
        fitness = RobustFitness(self._simulator, self._score, hypotheses, uncertainty())
        own = [controller.genome for controller in seeds if controller.design == design]
        search = self._make_search(design.weights, draw_genomes, settings, rng, own)
        finalists = min(FINALISTS, settings.population)
        rollouts = JUDGING * COST * settings.evaluations / 2
        conditions = (
            max(1, min(FINAL_CONDITIONS, round(rollouts / finalists))),
            max(2, min(JUDGED_CONDITIONS, round(rollouts / JUDGED))),
        )
        judging = finalists * conditions[0] + JUDGED * conditions[1]
        budget = (COST * settings.evaluations - judging) * steps
        spent, number, start = 0, 0, perf_counter()
        while number == 0 or (spent < budget and not search.stop()):
            controllers, before = self._controllers(search.ask()), self._simulator.stats.steps
            if isinstance(search, CmaEs):
                scores = _raced(fitness, search, controllers, steps, rng)
            else:
                scores = fitness(controllers, 1, steps, rng)[:, 0]
            search.tell(scores)
            cost = self._simulator.stats.steps - before
            spent += cost
            number += 1
            ahead = cost * len(search.ask()) / len(controllers)
            left = math.ceil(max(0, budget - spent) / ahead)
            on_generation(
                Generation(
                    number=number,
                    total=number + left,
                    best=float(scores.max()),
                    evaluations=search.evaluations,
                    seconds=perf_counter() - start,
                )
            )
        self.evaluations += search.evaluations
        found = self._controllers(search.candidates(finalists))
        for count in conditions:
            judged = fitness(found, count, steps, rng)
            best = np.argsort(-robust(judged), kind="stable")[:JUDGED]
            found, judged = [found[i] for i in best], judged[best]
        if not np.isfinite(judged).any():
            raise WorkError(
                f"no simulation of {self._simulator.robot.name} as {hypotheses[0]} remained "
                f"finite, with {search.evaluations} controllers: check the model, such as its "
                f"physics time step, masses and motors"
            )
        return tuple(map(CandidateController, found, judged))

    def _controllers(self, genomes: FloatArray) -> list[Controller]:
        return [Controller(self._design, genome) for genome in genomes]


def _raced(
    fitness: RobustFitness,
    search: CmaEs,
    controllers: Sequence[Controller],
    steps: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Returns scores of a generation of CMA-ES at a part of the cost, ``(controllers,)``.

    The random first generation has short rollouts. Later, only the leaders of each run, which it
    recombines, are simulated to the end.
    """
    if not search.groups:
        return fitness(controllers, 1, min(FIRST_STEPS, steps), rng)[:, 0]
    return fitness.race(controllers, search.groups, steps, rng)
