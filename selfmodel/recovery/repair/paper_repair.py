"""The paper's repair EA: evolves a controller in one exact simulation of a hypothesis."""

from collections.abc import Callable, Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.repair.candidate_controller import CandidateController
from selfmodel.recovery.scores.fitness import DISPLACEMENT, Score
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.cache import Cache
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Behaviour


class RepairSearch:
    """Repair EA, a ``Repair``, with a cache of the fitness of all rollouts.

    Source: the paper, section III.

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
        self._simulator = simulator
        self._settings = settings
        self._design = network_for(simulator.robot) if design is None else design
        self._fitness: Cache[Run] = Cache()
        self._score = score
        self.evaluations = 0

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        _uncertainty: Callable[[], Uncertainty],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns the surviving controllers for the first hypothesis, best first; see ``Repair``.

        Those after the best one are for a next trial if the best one was tried: it may be a seed.
        """
        genomes, fitness = self._evolved(hypotheses[0], seeds, rng, on_generation).survivors
        finite = zip(genomes[fitness > -np.inf], fitness[fitness > -np.inf], strict=True)
        found = {Controller(self._design, genome): value for genome, value in finite}
        return tuple(CandidateController(one, np.array([value])) for one, value in found.items())

    def best(
        self,
        hypothesis: Hypothesis,
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> Controller:
        """Returns the best controller found.

        Args:
            hypothesis: Faults of the simulated robot.
            seeds: Initial controllers in addition to random ones; controllers of another design
                are ignored.
            rng: Random number generator of all random choices.
            on_generation: Callback, called after each generation.

        Raises:
            WorkError: The simulation diverged with every controller.
        """
        search = self._evolved(hypothesis, seeds, rng, on_generation)
        return Controller(self._design, search.best)

    def _evolved(
        self,
        hypothesis: Hypothesis,
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> Evolution:
        """Returns the search after its last generation."""
        design = self._design

        def fitness(genomes: FloatArray) -> FloatArray:
            runs: list[Run] = [(hypothesis, Controller(design, genome)) for genome in genomes]
            return np.array(self._fitness.get_or_compute(runs, self._simulate))

        search = Evolution(
            design.weights,
            draw_genomes,
            self._settings,
            rng,
            [controller.genome for controller in seeds if controller.design == design],
        )
        evolve(search, fitness, on_generation)
        self.evaluations += search.evaluations
        if search.best_fitness == -np.inf:
            raise WorkError(
                f"no simulation of {self._simulator.robot.name} as {hypothesis} remained finite, "
                f"with {search.evaluations} controllers: check the model, such as its physics time "
                f"step, masses and motors"
            )
        return search

    def _simulate(self, runs: list[Run]) -> FloatArray:
        """Fitness of rollouts with one hypothesis; negative infinity for a diverged rollout."""
        outcome = self._simulator.run(runs, self._settings.steps, self._score.record)
        fitness, finite = np.full(len(runs), -np.inf), ~outcome.diverged
        if finite.any():
            simulated = outcome.behaviour
            signals = {signal: values[finite] for signal, values in simulated.signals.items()}
            behaviour = Behaviour(simulated.names, simulated.time, signals)
            fitness[finite] = self._score.of(self._simulator.robot, runs[0][0], behaviour)
        return fitness
