"""Repairs: searches for controllers that compensate for a failure.

``RepairSearch`` is the paper's: it evolves in one exact simulation of the diagnosed robot. A gait
that is evolved so depends on that simulation, and loses most of its speed on a physical robot. For
``RobustRepair`` every generation has new conditions: noise of the readings, initial poses,
parameters of the model and indistinguishable hypotheses (domain randomisation). Source: Jakobi,
Husbands and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy
transfer).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import (
    Draw,
    Evolution,
    GenerationCallback,
    GenomeSearch,
    evolve,
    reproduce,
)
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.cma_es import SEED_DEVIATION, CmaEs
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, Score, scores_of
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution, draw_samples
from selfmodel.simulation.simulator import Cache, Run, Simulator

FIRST_COST, COST = 2.8, 0.8
"""Simulated control steps of a robust repair without and with a known controller to begin from,
relative to those of the paper's repair EA."""

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


@dataclass(frozen=True, eq=False)
class CandidateController:
    """A controller for the next trial.

    Attributes:
        controller: The controller.
        scores: Score in simulation under each condition, ``(conditions,)``; a single one for
            a repair that simulates the self-model alone.
    """

    controller: Controller
    scores: FloatArray

    @property
    def predicted(self) -> float:
        """Mean predicted score of the rollouts that did not diverge; NaN if all did."""
        finite = self.scores[np.isfinite(self.scores)]
        return float(np.mean(finite)) if len(finite) else math.nan


class Repair(Protocol):
    """Search for controllers that compensate for the faults of a hypothesis.

    Attributes:
        evaluations: Number of controllers evaluated so far.
    """

    evaluations: int

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], DomainDistribution],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
        /,
    ) -> tuple[CandidateController, ...]:
        """Returns candidates for the next trial, best first, at least one.

        Args:
            hypotheses: The best hypothesis, then those indistinguishable from it.
            uncertainty: Returns the uncertainty of the self-model; not called by a repair that
                simulates the self-model alone.
            seeds: Known controllers; those of another design are ignored.
            rng: Random number generator of all random choices.
            on_generation: Callback, called after each generation.

        Raises:
            WorkError: The simulation diverged with every controller.
        """
        ...


MakeRepair = Callable[[Simulator, Settings, Design, Score], Repair]
"""Function that makes a repair from the self-model, the settings, the design of the controllers and
the score."""

MakeSearch = Callable[
    [int, Draw, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch
]
"""Function from the length of a genome, the distribution of random genomes, the settings, the
random number generator and initial genomes to a search."""


@dataclass(eq=False)
class RepairSearch:
    """The paper's repair EA, a ``Repair``: evolves in one exact simulation of a hypothesis.

    All rollouts are cached. Source: the paper, section III.

    Attributes:
        simulator: Self-model.
        settings: The paper's numbers.
        design: Design of the controllers to evolve; the paper's network if not given.
        score: Fitness.
        evaluations: Number of controllers evaluated so far.
    """

    simulator: Simulator
    settings: Settings
    design: Design | None = None
    score: Score = DISPLACEMENT
    evaluations: int = field(default=0, init=False)
    _fitness: Cache[Run] = field(default_factory=Cache, init=False)

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        _uncertainty: Callable[[], DomainDistribution],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns the surviving controllers for the first hypothesis, best first; see ``Repair``.

        Those after the best one are for a next trial if the best one was tried: it may be a seed.
        """
        hypothesis, design = hypotheses[0], self.design or network_for(self.simulator.robot)

        def fitness(genomes: FloatArray) -> FloatArray:
            runs: list[Run] = [(hypothesis, Controller(design, genome)) for genome in genomes]
            return np.array(self._fitness.get_or_compute(runs, self._simulate))

        known = [controller.genome for controller in seeds if controller.design == design]
        search = Evolution(design.weights, draw_genomes, self.settings, rng, known)
        evolve(search, fitness, on_generation, search.generations_left)
        self.evaluations += search.evaluations
        if search.best_fitness == -np.inf:
            none = f"none with {search.evaluations} controllers"
            raise _divergence(self.simulator, hypothesis, none)
        survivors = zip(*search.survivors, strict=True)
        scores = {Controller(design, one): score for one, score in survivors if score > -np.inf}
        return tuple(CandidateController(one, np.array([score])) for one, score in scores.items())

    def _simulate(self, runs: list[Run]) -> FloatArray:
        """Fitness of rollouts with one hypothesis; negative infinity for a diverged rollout."""
        outcome = self.simulator.run(runs, self.settings.steps, self.score.record)
        columns = outcome.grouped(len(runs), 1)
        return scores_of(self.score, self.simulator.robot, [runs[0][0]], columns)[:, 0]


@dataclass(frozen=True, eq=False)
class RobustFitness:
    """Scores of controllers under random conditions, common to all controllers of a call.

    The conditions have indistinguishable hypotheses in turn, and an uncertain model.
    """

    simulator: Simulator
    score: Score
    hypotheses: Sequence[Hypothesis]
    uncertainty: DomainDistribution

    def __call__(
        self, controllers: Sequence[Controller], count: int, steps: int, rng: np.random.Generator
    ) -> FloatArray:
        """Returns scores, ``(controllers, count)``; negative infinity for a diverged rollout."""
        conditions = draw_samples(self.hypotheses, self.uncertainty, count, rng)
        outcome = self.simulator.run_under(
            conditions, self.uncertainty, controllers, steps, self.score.record
        )
        faults = [condition.hypothesis for condition in conditions]
        return scores_of(self.score, self.simulator.robot, faults, outcome)


@dataclass(eq=False)
class RobustRepair:
    """Repair under uncertainty; a ``Repair``.

    Attributes:
        simulator: Self-model.
        settings: The paper's numbers; they set the cost of a repair.
        design: Design of the controllers to evolve.
        score: Fitness of a rollout.
        make_search: Makes the search.
        evaluations: Number of controllers evaluated so far.
    """

    simulator: Simulator
    settings: Settings
    design: Design
    score: Score = UPRIGHT
    make_search: MakeSearch = CmaEs
    evaluations: int = field(default=0, init=False)

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
        fitness = RobustFitness(self.simulator, self.score, hypotheses, uncertainty())
        known = [controller for controller in seeds if controller.design == self.design]
        comparisons = _comparisons(self.settings)
        compared = sum(candidates * conditions for candidates, conditions in comparisons)
        rollouts = rollouts_of(self.settings, known=bool(known)) - compared
        search = self._search(fitness, known, rollouts, rng, on_generation)
        self.evaluations += search.evaluations
        candidates = self._finalists(search, known, comparisons[0][0], rng)
        for count, conditions in comparisons:
            scores = fitness(candidates[:count], conditions, self.settings.steps, rng)
            best = np.argsort(-robust(scores), kind="stable")[:JUDGED]
            candidates, scores = [candidates[i] for i in best], scores[best]
        finite = np.isfinite(scores)
        viable = np.flatnonzero(finite.mean(axis=1) >= VIABLE)
        if not len(viable):
            share = f"{np.count_nonzero(finite)} of {finite.size}"
            best_of = f"with the best {len(finite)} of {search.evaluations} controllers"
            raise _divergence(self.simulator, hypotheses[0], f"{share} {best_of}")
        return tuple(CandidateController(candidates[i], scores[i]) for i in viable)

    def _search(
        self,
        fitness: RobustFitness,
        known: Sequence[Controller],
        rollouts: int,
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> GenomeSearch:
        """Returns the search after it has simulated as many steps as whole rollouts have."""
        design, stats = self.design, self.simulator.stats
        genomes = [controller.genome for controller in known]
        search = self.make_search(design.weights, draw_genomes, self.settings, rng, genomes)
        total, begin = rollouts * self.settings.steps, stats.steps
        halved = HALVED * total if self.score.grows_with_time else 0.0
        schedule = _Schedule(self.settings.steps, total, halved)

        def scores(asked: FloatArray) -> FloatArray:
            controllers = [Controller(design, genome) for genome in asked]
            return fitness(controllers, 1, schedule.horizon(stats.steps - begin), rng)[:, 0]

        def generations_left() -> int:
            return schedule.generations_left(len(search.ask()), stats.steps - begin)

        evolve(search, scores, on_generation, generations_left, noisy=True)
        return search

    def _finalists(
        self,
        search: GenomeSearch,
        known: Sequence[Controller],
        count: int,
        rng: np.random.Generator,
    ) -> list[Controller]:
        """Returns the candidates of a search and mutants of known controllers, ``count`` or fewer.

        A small search may end far below a known controller; its mutants do not.
        """
        design = self.design
        near = mutants(known, count // 3, self.settings, rng) if known else []
        evolved = [Controller(design, genome) for genome in search.candidates(count)]
        new = [one for one in dict.fromkeys([*near, *evolved]) if one not in known][:count]
        # A search of one generation may have evaluated known controllers alone.
        return new or [Controller(design, draw_genomes(rng, (design.weights,)))]


@dataclass(frozen=True)
class _Schedule:
    """Length of the rollouts of a search, and its end.

    The random genomes of the first generation need few steps. Where short rollouts rank controllers
    as whole ones do, the first part of a search affords twice as many of them.

    Attributes:
        whole: Control steps of a trial.
        total: Control steps of the search.
        halved: Control steps of the search up to which rollouts have half of the steps of a trial.
    """

    whole: int
    total: int
    halved: float

    @property
    def _half(self) -> int:
        return min(self.whole, max(SHORT_STEPS, self.whole // 2))

    def horizon(self, spent: int) -> int:
        """Returns the control steps of the next rollouts of a search that has spent some."""
        if not spent:
            return min(SHORT_STEPS, self.whole)
        return self._half if spent < self.halved else self.whole

    def generations_left(self, size: int, spent: int) -> int:
        """Returns the number of generations of a size that spend what is left."""
        short = math.ceil(max(0.0, self.halved - spent) / (size * self._half))
        rest = max(0.0, self.total - max(spent, self.halved))
        return short + math.ceil(rest / (size * self.whole))


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
    """Returns the whole rollouts that a robust repair may cost, with a known controller or not."""
    most = FIRST_COST * settings.evaluations
    return round(min(most, max(COST * settings.evaluations, ENOUGH)) if known else most)


def _comparisons(settings: Settings) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the number of candidates and of conditions of both comparisons."""
    finalists = min(FINALISTS, settings.population)
    rollouts = JUDGING * settings.evaluations / 2
    first = max(1, min(FINAL_CONDITIONS, round(rollouts / finalists)))
    last = max(2, min(JUDGED_CONDITIONS, round(rollouts / JUDGED)))
    return (finalists, first), (JUDGED, last)


def mutants(
    parents: Sequence[Controller], count: int, settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns children by the mutation and the crossover of the paper's EA, of parents in turn."""
    design = parents[0].design
    genomes = np.resize([parent.genome for parent in parents], (count, design.weights))
    return [Controller(design, child) for child in reproduce(genomes, draw_genomes, settings, rng)]


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


def _divergence(simulator: Simulator, hypothesis: Hypothesis, finite: str) -> WorkError:
    return WorkError(
        f"expected finite simulations of {simulator.robot.name} as {hypothesis}, got {finite}: "
        f"check the model, such as its physics time step, masses and motors"
    )
