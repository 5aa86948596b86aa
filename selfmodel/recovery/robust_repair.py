"""Robust repair: evolves controllers on rollouts under random conditions.

A gait that is evolved in one exact simulation depends on that simulation: on a physical robot it
loses most of its speed. Here every generation has new conditions: noise of the readings, initial
poses, parameters of the model and indistinguishable hypotheses (domain randomisation). Source:
Jakobi, Husbands and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy
transfer).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Draw, Generation, GenerationCallback
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.cma_es import SEED_DEVIATION, CmaEs
from selfmodel.recovery.repair import CandidateController, mutants
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.scores import UPRIGHT, Score, scores_of
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution, draw_samples
from selfmodel.simulation.simulator import Simulator

FIRST_COST, COST = 2.8, 0.8
"""Simulated control steps of a repair without and with a known controller to begin from, relative
to those of the paper's repair EA."""

ENOUGH = 600
"""Rollouts up to which a repair with a known controller costs as much as one without: fewer may end
below the known controller."""

SHORT_STEPS = 200
"""Control steps of the first generation, of random genomes."""

REPERTOIRE_COST = 1 / 8
"""Control steps of a first generation of a repertoire's gaits, relative to those of the paper's
repair EA."""

HALVED = 0.4
"""Share of a search's control steps in which its rollouts have half of the steps of a trial, with
a score that grows with time."""

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

TAIL = 0.25
"""Fraction of the conditions, those with the lowest scores, that count as the lower tail."""


class GenomeSearch(Protocol):
    """Search over genomes; a noisy fitness is maximised. The caller ends it.

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


MakeSearch = Callable[
    [int, Draw, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch
]
"""Function from the length of a genome, the distribution of random genomes, the settings, the
random number generator and initial genomes to a search."""


@dataclass(frozen=True, eq=False)
class RobustFitness:
    """Scores of controllers under random conditions, common to all controllers of a call.

    Attributes:
        simulator: Self-model.
        score: Score of a rollout.
        hypotheses: Indistinguishable hypotheses, at least one.
        uncertainty: Distribution of the rollouts.
    """

    simulator: Simulator
    score: Score
    hypotheses: Sequence[Hypothesis]
    uncertainty: DomainDistribution

    def __call__(
        self, controllers: Sequence[Controller], count: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores, ``(controllers, count)``; negative infinity for a diverged rollout.

        Args:
            controllers: At least one controller.
            count: Number of conditions.
            steps: Control steps of a rollout.
            rng: Random number generator of the conditions.
        """
        conditions = draw_samples(self.hypotheses, self.uncertainty, count, rng)
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, self.score.record
        )
        columns = [
            scores_of(self.score, self.simulator.robot, own.hypothesis, outcome, column)
            for column, own in enumerate(conditions)
        ]
        return np.stack(columns, axis=1)


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
        uncertainty: Callable[[], DomainDistribution],
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
        comparisons = _comparisons(self._settings)
        judging = sum(candidates * conditions for candidates, conditions in comparisons)
        rollouts = rollouts_of(self._settings, known=bool(known)) - judging
        search = self._searched(fitness, known, rollouts * self._settings.steps, rng, on_generation)
        self.evaluations += search.evaluations
        found = self._finalists(search, known, comparisons[0][0], rng)
        for count, conditions in comparisons:
            scores = fitness(found[:count], conditions, self._settings.steps, rng)
            best = np.argsort(-robust(scores), kind="stable")[:JUDGED]
            found, scores = [found[i] for i in best], scores[best]
        finite = np.isfinite(scores)
        viable = np.flatnonzero(finite.mean(axis=1) >= VIABLE)
        if not len(viable):
            raise WorkError(
                f"expected finite simulations of {self._simulator.robot.name} as {hypotheses[0]}, "
                f"got {np.count_nonzero(finite)} of {finite.size} with the best {len(finite)} of "
                f"{search.evaluations} controllers: check the model, such as its physics time "
                f"step, masses and motors"
            )
        return tuple(CandidateController(found[i], scores[i]) for i in viable)

    def _searched(
        self,
        fitness: RobustFitness,
        known: Sequence[Controller],
        budget: int,
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> GenomeSearch:
        """Returns the search after it has spent a budget of control steps."""
        design, stats, start = self._design, self._simulator.stats, perf_counter()
        genomes = [controller.genome for controller in known]
        search = self._make_search(design.weights, draw_genomes, self._settings, rng, genomes)
        begin, number = stats.steps, 0
        while not number or stats.steps - begin < budget:
            asked = [Controller(design, genome) for genome in search.ask()]
            steps = self._horizon(number, stats.steps - begin, budget)
            scores = fitness(asked, 1, steps, rng)[:, 0]
            search.tell(scores)
            number += 1
            left = self._generations_left(len(search.ask()), stats.steps - begin, budget)
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

    def _horizon(self, number: int, spent: int, budget: int) -> int:
        """Returns the control steps of the rollouts of a generation.

        The random genomes of the first generation need few. Where short rollouts rank controllers
        as whole ones do, the first part of a search affords twice as many of them.

        Args:
            number: Number of the generation, from 0.
            spent: Control steps that the search has simulated.
            budget: Control steps of the search.
        """
        if number == 0:
            return min(SHORT_STEPS, self._settings.steps)
        return self._half if spent < self._halved(budget) else self._settings.steps

    def _halved(self, budget: int) -> float:
        """Control steps of a search up to which its rollouts have half of the steps of a trial."""
        return HALVED * budget if self._score.grows_with_time else 0.0

    @property
    def _half(self) -> int:
        """Half of the steps of a trial, but no fewer than those of a short rollout."""
        return min(self._settings.steps, max(SHORT_STEPS, self._settings.steps // 2))

    def _generations_left(self, size: int, spent: int, budget: int) -> int:
        """Returns the number of generations of a size that spend the rest of a budget."""
        halved = self._halved(budget)
        short = math.ceil(max(0.0, halved - spent) / (size * self._half))
        rest = max(0.0, budget - max(spent, halved))
        return short + math.ceil(rest / (size * self._settings.steps))

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
        design = self._design
        near = mutants(known, count // 3, self._settings, rng) if known else []
        evolved = [Controller(design, genome) for genome in search.candidates(count)]
        found = [one for one in dict.fromkeys([*near, *evolved]) if one not in known][:count]
        # A search of one generation may have evaluated known controllers alone.
        return found or [Controller(design, draw_genomes(rng, (design.weights,)))]


def robust(scores: FloatArray) -> FloatArray:
    """Returns the mean of the mean score and of the mean of the lower tail, ``(controllers,)``.

    A rollout that diverged counts as worse than all others by 1; a controller of which all did has
    negative infinity.

    Args:
        scores: ``(controllers, conditions)``.
    """
    finite = np.isfinite(scores)
    if not finite.any():
        return np.full(len(scores), -np.inf)
    known = np.where(finite, scores, scores[finite].min() - 1.0)
    tail = np.sort(known, axis=1)[:, : max(1, round(TAIL * scores.shape[1]))]
    values = (known.mean(axis=1) + tail.mean(axis=1)) / 2
    return np.asarray(np.where(finite.any(axis=1), values, -np.inf))


def rollouts_of(settings: Settings, *, known: bool) -> int:
    """Returns the number of whole rollouts that a repair may cost.

    Args:
        settings: The paper's numbers.
        known: Whether there is a known controller to begin from.
    """
    most = FIRST_COST * settings.evaluations
    return round(min(most, max(COST * settings.evaluations, ENOUGH)) if known else most)


def _comparisons(settings: Settings) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the number of candidates and of conditions of both comparisons."""
    finalists = min(FINALISTS, settings.population)
    rollouts = JUDGING * settings.evaluations / 2
    first = max(1, min(FINAL_CONDITIONS, round(rollouts / finalists)))
    last = max(2, min(JUDGED_CONDITIONS, round(rollouts / JUDGED)))
    return (finalists, first), (JUDGED, last)


def from_repertoire(repertoire: Repertoire) -> MakeSearch:
    """Returns a function that makes CMA-ES whose runs begin from gaits of a repertoire.

    A random sample of the gaits, over short rollouts, takes the place of random genomes. The best
    of them start the runs. Source of the idea: Cully et al., *Robots that can adapt like animals*
    (Nature 2015); here the gaits are evaluated under the diagnosed faults, which takes no
    physical trial.

    Args:
        repertoire: Gaits of the healthy robot, with controllers of the design that is searched.
    """

    def drawn(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        count, gaits = shape[0], len(repertoire)
        return repertoire.genomes[rng.choice(gaits, count, replace=count > gaits)]

    def make(
        length: int,
        _draw: Draw,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> CmaEs:
        longer = settings.steps / min(SHORT_STEPS, settings.steps)
        gaits = min(len(repertoire), round(REPERTOIRE_COST * settings.evaluations * longer))
        share = (gaits + len(seeds)) / settings.population
        return CmaEs(length, drawn, settings, rng, seeds, share=share, deviation=SEED_DEVIATION)

    return make
