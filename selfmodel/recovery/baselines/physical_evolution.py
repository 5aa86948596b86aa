"""The paper's control: evolution on the physical robot, one physical trial an evaluation."""

import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.evolution import Evolution
from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)
from selfmodel.settings import Settings


def physical_evolution(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Evolves controllers on the physical robot, with the EA of the paper and no self-model.

    Source: the paper, section IV: the control experiment.
    """
    trials = PhysicalTrials(problem, settings, on_trial)
    design = problem.design
    parameters = Settings().scaled(settings.population)
    search = Evolution(design.weights, draw_genomes, parameters, rng)
    while trials.left:
        genomes = search.ask()
        fitness = [trials.run(Controller(design, genome)) for genome in genomes[: trials.left]]
        if len(fitness) == len(genomes):
            search.tell(np.array(fitness))
    return trials.done
