"""The repair EA: evolves a controller that makes a robot with a given hypothesis walk."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.evolution import Evolution, GenerationCallback, evolve
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.fitness import DISPLACEMENT, Score
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.cache import Cache
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Behaviour


class RepairSearch:
    """Evolves controllers in simulation; it remembers the fitness of every run.

    Fitness is the forward displacement in metres, or another score. Source: the paper, section III.

    Args:
        simulator: The self-model.
        settings: The numbers of the search.
        design: The kind of controller to evolve; the paper's network for the simulator's robot if
            none is given.
        evaluations: Controllers that were asked about before.
        score: The fitness.
    """

    def __init__(
        self,
        simulator: Simulator,
        settings: Settings,
        design: Design | None = None,
        evaluations: int = 0,
        score: Score = DISPLACEMENT,
    ) -> None:
        self._simulator = simulator
        self._settings = settings
        self._design = network_for(simulator.robot) if design is None else design
        self._fitness: Cache[Run] = Cache()
        self._score = score
        self.evaluations = evaluations

    def __call__(
        self,
        hypothesis: Hypothesis,
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> Controller:
        """Returns the best controller found.

        Args:
            hypothesis: What is taken to be wrong with the robot.
            seeds: Controllers to start from, beside random ones; those of another design are left
                out.
            rng: Every random choice comes from it.
            on_generation: Is told of every generation.
        """
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
        return Controller(design, search.best)

    def _simulate(self, runs: list[Run]) -> FloatArray:
        """The fitness of runs with one hypothesis; the worst for those that diverge."""
        outcome = self._simulator.run(runs, self._settings.steps, self._score.record)
        fitness, sound = np.full(len(runs), -np.inf), ~outcome.diverged
        if sound.any():
            all_of = outcome.behaviour
            signals = {signal: values[sound] for signal, values in all_of.signals.items()}
            behaviour = Behaviour(all_of.names, all_of.time, signals)
            fitness[sound] = self._score.of(self._simulator.robot, runs[0][0], behaviour)
        return fitness
