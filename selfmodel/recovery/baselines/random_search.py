"""Random search on the physical robot."""

import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)


def random_search(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Tries controllers with random genomes on the physical robot."""
    trials = PhysicalTrials(problem, settings, on_trial)
    while trials.left:
        trials.run(Controller(problem.design, draw_genomes(rng, (problem.design.weights,))))
    return trials.done
