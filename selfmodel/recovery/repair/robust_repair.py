"""Robust repair: evolves controllers on rollouts under random conditions.

A gait that is evolved in one exact simulation depends on that simulation: on a physical robot it
loses most of its speed. Here every generation has new conditions: noise of the readings, initial
poses, parameters of the model and indistinguishable hypotheses. Source: Jakobi, Husbands
and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy transfer).
"""

import math
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Generation, GenerationCallback, reproduce
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.repair.candidate_controller import CandidateController
from selfmodel.recovery.repair.cma_es import CmaEs
from selfmodel.recovery.repair.genome_search import SHORT_STEPS, GenomeSearch, MakeSearch
from selfmodel.recovery.repair.robust_fitness import RobustFitness, robust
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.settings import Settings
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.simulator import Simulator

FIRST_COST, COST = 2.8, 0.8
"""Simulated control steps of a repair without and with a known controller to begin from, relative
to those of the paper's repair EA."""

ENOUGH = 600
"""Rollouts up to which a repair with a known controller costs as much as one without: fewer may end
below the known controller."""

HALVED = 0.4
"""Share of a search's budget in which its rollouts have half of the steps of a trial, with a score
that grows with time."""

FINALISTS, FINAL_CONDITIONS = 12, 4
"""Largest numbers of candidates of a search, and of conditions under which they are compared."""

JUDGED, JUDGED_CONDITIONS = 4, 16
"""Number of the best candidates of that comparison, and largest number of conditions under which
these are compared at last."""

JUDGING = 0.08
"""Cost of both comparisons relative to the evaluations of the paper's repair EA. That of a small
repair is larger: every candidate has one condition and then two."""

VIABLE = 0.5
"""Smallest share of the last conditions in which the rollouts of a candidate remain finite."""


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
            WorkError: The simulation diverged under most conditions with every candidate.
        """
        fitness = RobustFitness(self._simulator, self._score, hypotheses, uncertainty())
        known = [controller for controller in seeds if controller.design == self._design]
        evaluations = rollouts_of(self._settings, known=bool(known))
        comparisons = _comparisons(self._settings)
        judging = sum(candidates * conditions for candidates, conditions in comparisons)
        budget = float(evaluations - judging) * self._settings.steps
        search = self._searched(fitness, known, budget, rng, on_generation)
        self.evaluations += search.evaluations
        found = self._finalists(search, known, comparisons[0][0], rng)
        for count, conditions in comparisons:
            judged = fitness(found[:count], conditions, self._settings.steps, rng)
            best = np.argsort(-robust(judged), kind="stable")[:JUDGED]
            found, judged = [found[i] for i in best], judged[best]
        finite = np.isfinite(judged)
        viable = np.flatnonzero(finite.mean(axis=1) >= VIABLE)
        if not len(viable):
            raise WorkError(
                f"expected finite simulations of {self._simulator.robot.name} as {hypotheses[0]}, "
                f"got {np.count_nonzero(finite)} of {finite.size} with the best {len(finite)} of "
                f"{search.evaluations} controllers: check the model, such as its physics time "
                f"step, masses and motors"
            )
        return tuple(CandidateController(found[i], judged[i]) for i in viable)

    def _searched(
        self,
        fitness: RobustFitness,
        known: Sequence[Controller],
        budget: float,
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> GenomeSearch:
        """Returns the search after it has spent a budget of control steps."""
        genomes = [controller.genome for controller in known]
        design, settings, stats = self._design, self._settings, self._simulator.stats
        halved = HALVED * budget if self._score.grows_with_time else 0.0
        search = self._make_search(design.weights, draw_genomes, settings, rng, genomes)
        begin, number, start = stats.steps, 0, perf_counter()
        while not number or stats.steps - begin < budget:
            before, asked = stats.steps, self._controllers(search.ask())
            steps = _half(settings.steps) if before - begin < halved else settings.steps
            scores = _scores(fitness, search, asked, steps, rng)
            search.tell(scores)
            number += 1
            ahead = (stats.steps - before) / steps * len(search.ask()) / len(asked)
            left = _generations(begin + budget - stats.steps, ahead * settings.steps)
            if stats.steps - begin < halved:
                short = ahead * _half(settings.steps)
                left = _generations(begin + halved - stats.steps, short) + _generations(
                    budget - halved, ahead * settings.steps
                )
            on_generation(
                Generation(
                    number=number,
                    total=number + left,
                    best=float(scores.max()),
                    evaluations=search.evaluations,
                    seconds=perf_counter() - start,
                )
            )
        return search

    def _finalists(
        self,
        search: GenomeSearch,
        known: Sequence[Controller],
        count: int,
        rng: np.random.Generator,
    ) -> list[Controller]:
        """Returns the candidates of a search and mutants of known controllers, ``count`` or fewer.

        A search with a small budget may end far below a known controller; its mutants do not.
        """
        weights = self._design.weights
        near: list[Controller] = []
        if known:
            genomes = np.resize([one.genome for one in known], (count // 3, weights))
            near = self._controllers(reproduce(genomes, draw_genomes, self._settings, rng))
        distinct = dict.fromkeys([*near, *self._controllers(search.candidates(count))])
        found = [one for one in distinct if one not in known][:count]
        # A search of one generation may have evaluated known controllers alone.
        return found or self._controllers(draw_genomes(rng, (1, weights)))

    def _controllers(self, genomes: FloatArray) -> list[Controller]:
        return [Controller(self._design, genome) for genome in genomes]


def rollouts_of(settings: Settings, *, known: bool) -> int:
    """Returns the number of whole rollouts that a repair may cost.

    Args:
        settings: The paper's numbers.
        known: Whether there is a known controller to begin from.
    """
    most = FIRST_COST * settings.evaluations
    return round(min(most, max(COST * settings.evaluations, ENOUGH)) if known else most)


def _half(steps: int) -> int:
    """Returns half of the steps of a rollout, but no fewer than those of a short one."""
    return min(steps, max(SHORT_STEPS, steps // 2))


def _generations(budget: float, cost: float) -> int:
    """Returns the number of generations of a cost that spend a budget."""
    return math.ceil(max(0.0, budget) / cost)


def _comparisons(settings: Settings) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the number of candidates and of conditions of both comparisons."""
    finalists = min(FINALISTS, settings.population)
    rollouts = JUDGING * settings.evaluations / 2
    first = max(1, min(FINAL_CONDITIONS, round(rollouts / finalists)))
    last = max(2, min(JUDGED_CONDITIONS, round(rollouts / JUDGED)))
    return (finalists, first), (JUDGED, last)


def _scores(
    fitness: RobustFitness,
    search: GenomeSearch,
    controllers: Sequence[Controller],
    steps: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Returns the scores of a generation, ``(controllers,)``, with the rollouts that it needs."""
    horizon = min(SHORT_STEPS, steps) if search.rollouts == "short" else steps
    return fitness(controllers, 1, horizon, rng)[:, 0]
