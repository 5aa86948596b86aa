"""Repairs: searches for controllers that compensate for a failure; the paper's repair."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Evolution, GenerationCallback, evolve, reproduce
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.scores import DISPLACEMENT, Score, scores_of
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.simulator import Cache, Run, Simulator


@dataclass(frozen=True, eq=False)
class CandidateController:
    """A controller for the next trial, with its predicted scores.

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


def mutants(
    parents: Sequence[Controller], count: int, settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns children of controllers by the mutation and the crossover of the paper's EA.

    Args:
        parents: At least one controller, all of one design, used in turn.
        count: Number of children.
        settings: Numbers of the EA.
        rng: Random number generator of all random choices.
    """
    design = parents[0].design
    genomes = np.resize([parent.genome for parent in parents], (count, design.weights))
    return [Controller(design, own) for own in reproduce(genomes, draw_genomes, settings, rng)]


class RepairSearch:
    """The paper's repair EA, a ``Repair``: evolves in one exact simulation of a hypothesis.

    All rollouts are cached. Source: the paper, section III.

    Args:
        simulator: Self-model.
        settings: The paper's numbers.
        design: Design of the controllers to evolve; the paper's network for the simulator's robot
            if not given.
        score: Fitness; the forward displacement in metres if not given.

    Attributes:
        evaluations: Number of controllers evaluated so far.
    """

    def __init__(
        self,
        simulator: Simulator,
        settings: Settings,
        design: Design | None = None,
        score: Score = DISPLACEMENT,
    ) -> None:
        self._simulator, self._settings, self._score = simulator, settings, score
        self._design = network_for(simulator.robot) if design is None else design
        self._fitness: Cache[Run] = Cache()
        self.evaluations = 0

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
        design, hypothesis = self._design, hypotheses[0]

        def fitness(genomes: FloatArray) -> FloatArray:
            runs: list[Run] = [(hypothesis, Controller(design, genome)) for genome in genomes]
            return np.array(self._fitness.get_or_compute(runs, self._simulate))

        known = [controller.genome for controller in seeds if controller.design == design]
        search = Evolution(design.weights, draw_genomes, self._settings, rng, known)
        evolve(search, fitness, on_generation)
        self.evaluations += search.evaluations
        if search.best_fitness == -np.inf:
            raise WorkError(
                f"no simulation of {self._simulator.robot.name} as {hypothesis} remained finite, "
                f"with {search.evaluations} controllers: check the model, such as its physics time "
                f"step, masses and motors"
            )
        survivors = zip(*search.survivors, strict=True)
        found = {Controller(design, own): value for own, value in survivors if value > -np.inf}
        return tuple(CandidateController(one, np.array([value])) for one, value in found.items())

    def _simulate(self, runs: list[Run]) -> FloatArray:
        """Fitness of rollouts with one hypothesis; negative infinity for a diverged rollout."""
        outcome = self._simulator.run(runs, self._settings.steps, self._score.record)
        return scores_of(self._score, self._simulator.robot, runs[0][0], outcome)
