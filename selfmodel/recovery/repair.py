"""Repairs: searches for controllers that compensate for a failure.

``RepairSearch`` is the paper's: it evolves in one exact simulation of the diagnosed robot. A gait
that is evolved so depends on that simulation, and loses most of its speed on a physical robot. For
``RobustRepair`` every generation has new conditions: noise of the readings, initial poses,
parameters of the model and indistinguishable hypotheses (domain randomisation). Source: Jakobi,
Husbands and Harvey, "Noise and the reality gap" (ECAL 1995); the paper, section VI (noisy
transfer).
"""

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol

import numpy as np

from selfmodel import evolution
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.evolution import Evolution, GenerationCallback, GenomeSearch
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.candidates import (
    CandidateController,
    Candidates,
    RobustFitness,
    converged,
    divergence,
    robust,
    unflattered,
    viable,
)
from selfmodel.recovery.cma_es import SEED_DEVIATION, CmaEs
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, Score, scores_of
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Run, Simulator, cached_rows

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

LEAST = 8
"""Part of its steps that a rollout which ended early counts as at least."""

FINALISTS, FINAL_CONDITIONS = 12, 4
"""Largest numbers of candidates of a search, and of conditions under which they are compared."""

JUDGED, JUDGED_CONDITIONS = 4, 16
"""Number of the best candidates of that comparison, and largest number of conditions under which
these are compared at last."""

JUDGING = 0.08
"""Cost of both comparisons relative to the evaluations of the paper's repair EA. That of a small
repair is larger: every candidate has one condition and then two."""

HEADINGS = 0.3
"""Standard deviation of the initial heading of rollouts of controllers that hold theirs, rad: what
turns a physical robot is in no model, and such a controller has to turn it back."""


class Repair(Protocol):
    """Search for controllers that compensate for the faults of a hypothesis.

    Attributes:
        evaluations: Number of controllers evaluated so far.
        adapts_gait: Whether it changes the controller of the robot, and evolves no other: a robot
            that is found intact keeps its controller, and one that walks as before needs no
            further trial.
    """

    evaluations: int
    adapts_gait: ClassVar[bool]

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

MakeSearch = Callable[[int, Settings, np.random.Generator, Sequence[FloatArray]], GenomeSearch]
"""Function from the length of a genome, the settings, the random number generator and initial
genomes to a search."""


@dataclass(eq=False)
class RepairSearch:
    """The paper's repair EA, a ``Repair``: evolves in one exact simulation of a hypothesis.

    The candidates are the surviving controllers: those after the best one are for a next trial if
    the best one was tried; it may be a seed. All rollouts are cached. The design is the paper's
    network if not given. Source: the paper, section III.
    """

    simulator: Simulator
    settings: Settings
    design: Design | None = None
    score: Score = DISPLACEMENT
    adapts_gait: ClassVar[bool] = False
    evaluations: int = field(default=0, init=False)
    _known: dict[Run, FloatArray] = field(default_factory=dict, init=False)

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        _uncertainty: Callable[[], DomainDistribution],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns the surviving controllers for the first hypothesis, best first."""
        hypothesis, design = hypotheses[0], self.design or network_for(self.simulator.robot)

        def fitness(genomes: FloatArray) -> FloatArray:
            runs: list[Run] = [(hypothesis, Controller(design, genome)) for genome in genomes]
            return np.array(cached_rows(self._known, runs, self._simulate))

        known = [one.genome for one in seeds if one.design == design]
        search = Evolution(design.weights, self.settings, rng, known, draw=draw_genomes)
        evolution.evolve(search, fitness, on_generation, search.generations_left)
        self.evaluations += search.evaluations
        if search.best_fitness == -np.inf:
            none = f"none with {search.evaluations} controllers"
            raise divergence(self.simulator, hypothesis, none)
        survivors = zip(*search.survivors, strict=True)
        scores = {Controller(design, one): score for one, score in survivors if score > -np.inf}
        return tuple(CandidateController(one, np.array([score])) for one, score in scores.items())

    def _simulate(self, runs: list[Run]) -> FloatArray:
        """Fitness of rollouts with one hypothesis; negative infinity for a diverged rollout."""
        outcome = self.simulator.run(runs, self.settings.steps, self.score.record)
        columns = outcome.grouped(len(runs), 1)
        return scores_of(self.score, self.simulator.robot, [runs[0][0]], columns)[:, 0]


@dataclass(eq=False)
class RobustRepair:
    """Repair under uncertainty; a ``Repair`` whose cost follows from the paper's numbers.

    Attributes:
        parts: Physics steps in place of each; see ``unflattered``.
    """

    simulator: Simulator
    settings: Settings
    design: Design
    score: Score = UPRIGHT
    make_search: MakeSearch = CmaEs
    adapts_gait: ClassVar[bool] = False
    evaluations: int = field(default=0, init=False)
    parts: int = field(default=1, init=False)

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], DomainDistribution],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns candidates of a search, compared under more conditions, best first.

        A small search may end far below a known controller; its mutants, which are compared too, do
        not. A candidate whose rollouts diverged under most conditions is left out.
        """
        drawn = uncertainty()
        if self.design.heading:
            start = replace(drawn.start, heading=HEADINGS)
            drawn = replace(drawn, start=start)
        comparisons = comparisons_of(self.settings)
        compared = sum(candidates * conditions for candidates, conditions in comparisons)
        known = [controller for controller in seeds if controller.design == self.design]
        rollouts = rollouts_of(self.settings, known=bool(known)) - compared

        def searched() -> tuple[Candidates, Candidates]:
            fitness = RobustFitness(self.simulator, self.score, hypotheses, drawn)
            genomes = [controller.genome for controller in known]
            search = self.make_search(self.design.weights, self.settings, rng, genomes)
            run_search(
                *(search, fitness, self.design),
                rollouts=rollouts,
                steps=self.settings.steps,
                rng=rng,
                on_generation=on_generation,
            )
            self.evaluations += search.evaluations
            count = comparisons[0][0]
            near = mutants(known, count // 3, self.settings, rng) if known else []
            evolved = [Controller(self.design, genome) for genome in search.candidates(count)]
            new = [one for one in dict.fromkeys([*near, *evolved]) if one not in known]
            # A search of one generation may have evaluated known controllers alone.
            candidates = new or [_random_controller(self.design, rng)]
            for count, conditions in comparisons:
                again = copy.deepcopy(rng)
                scores = fitness(candidates[:count], conditions, self.settings.steps, rng)
                best = np.argsort(-robust(scores), kind="stable")[:JUDGED]
                candidates, scores = [candidates[i] for i in best], scores[best]
            finite = viable(candidates, scores, fitness, search.evaluations)
            return finite, converged(finite, fitness, self.settings.steps, again)

        return unflattered(self, searched)


def run_search(
    search: GenomeSearch,
    fitness: RobustFitness,
    design: Design,
    *,
    rollouts: int,
    steps: int,
    rng: np.random.Generator,
    on_generation: GenerationCallback,
    conditions: int = 1,
    count_ended: bool = True,
) -> None:
    """Runs a search for as many control steps as whole rollouts have.

    The first generation needs few steps: its genomes are random. Where short rollouts rank
    controllers as whole ones do, the first part of a search affords twice as many of them.

    Args:
        search: The search; its fitness is maximised.
        fitness: Scores of controllers.
        design: Design of the genomes.
        rollouts: Whole rollouts that the search may cost.
        steps: Control steps of a whole rollout.
        rng: Random number generator of the conditions.
        on_generation: Callback, called after each generation.
        conditions: Conditions under which each genome is evaluated.
        count_ended: Whether the steps count that a rollout did not simulate because it ended, as by
            a fall. If not, a search in which most fall has more generations.
    """
    stats = fitness.simulator.stats
    total, spent = rollouts * steps, 0
    halved = HALVED * total if fitness.score.grows_with_time else 0.0
    short, half = min(SHORT_STEPS, steps), min(steps, max(SHORT_STEPS, steps // 2))

    def scores(asked: FloatArray) -> FloatArray:
        nonlocal spent
        now = short if not spent else half if spent < halved else steps
        before, whole = stats.steps, len(asked) * conditions * now
        found = robust(fitness([Controller(design, one) for one in asked], conditions, now, rng))
        spent += whole if count_ended else max(stats.steps - before, whole // LEAST)
        return found

    def generations_left() -> int:
        size = len(search.ask()) * conditions
        halves = math.ceil(max(0.0, halved - spent) / (size * half))
        return halves + math.ceil(max(0.0, total - max(spent, halved)) / (size * steps))

    evolution.evolve(search, scores, on_generation, generations_left, noisy=True)


def rollouts_of(settings: Settings, *, known: bool) -> int:
    """Returns the whole rollouts that a robust repair may cost, with a known controller or not."""
    most = FIRST_COST * settings.evaluations
    return round(min(most, max(COST * settings.evaluations, ENOUGH)) if known else most)


def comparisons_of(settings: Settings) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the number of candidates and of conditions of both comparisons."""
    finalists = min(FINALISTS, settings.population)
    rollouts = JUDGING * settings.evaluations / 2
    first = max(1, min(FINAL_CONDITIONS, round(rollouts / finalists)))
    last = max(2, min(JUDGED_CONDITIONS, round(rollouts / JUDGED)))
    return (finalists, first), (JUDGED, last)


def _random_controller(design: Design, rng: np.random.Generator) -> Controller:
    return Controller(design, draw_genomes(rng, (design.weights,)))


def mutants(
    parents: Sequence[Controller], count: int, settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns children by the mutation and the crossover of the paper's EA, of parents in turn."""
    design = parents[0].design
    genomes = np.resize([parent.genome for parent in parents], (count, design.weights))
    children = evolution.reproduce(genomes, draw_genomes, settings, rng)
    return [Controller(design, child) for child in children]


def untried_mutants(
    parents: Sequence[Controller],
    tried: Sequence[Controller],
    settings: Settings,
    rng: np.random.Generator,
) -> list[Controller]:
    """Returns one population of distinct mutants that were not tried, or a random controller."""
    distinct = dict.fromkeys(mutants(parents, settings.population, settings, rng))
    untried = [controller for controller in distinct if controller not in tried]
    # Every mutant may equal its parent, as without mutation.
    return untried or [_random_controller(parents[0].design, rng)]


def from_repertoire(repertoire: Repertoire) -> MakeSearch:
    """Returns a function that makes CMA-ES whose runs begin from gaits of a repertoire.

    A random sample of the gaits, over short rollouts, takes the place of random genomes. The best
    of them start the runs. Source of the idea: Cully et al., *Robots that can adapt like animals*
    (Nature 2015); here the gaits are evaluated under the diagnosed faults, which takes no
    physical trial.
    """

    def drawn(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        count, gaits = shape[0], len(repertoire)
        return repertoire.genomes[rng.choice(gaits, count, replace=count > gaits)]

    def make(
        length: int,
        settings: Settings,
        rng: np.random.Generator,
        seeds: Sequence[FloatArray] = (),
    ) -> CmaEs:
        longer = settings.steps / min(SHORT_STEPS, settings.steps)
        gaits = min(len(repertoire), round(REPERTOIRE_COST * settings.evaluations * longer))
        return CmaEs(
            *(length, settings, rng, seeds), draw=drawn, random=gaits, deviation=SEED_DEVIATION
        )

    return make
