"""Evolution of new gaits for the healthy robot, without a diagnosis."""

import numpy as np

from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)


def healthy_evolution(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Searches in simulation of the healthy robot with noise, and tries the best controllers.

    The trials run the distinct controllers of one search, best first: what the failure spares.
    """
    found = problem.search(problem.design, problem.healthy, settings.evaluations, rng)
    trials = PhysicalTrials(problem, settings, on_trial)
    for controller in found[: settings.trials]:
        trials.run(controller)
    return trials.done
