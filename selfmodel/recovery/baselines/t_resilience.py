"""T-Resilience: a multi-objective EA that learns to avoid what does not transfer; no diagnosis.

Source: S. Koos, A. Cully and J.-B. Mouret, *Fast damage recovery in robotics with the T-Resilience
algorithm* (International Journal of Robotics Research 32:1700, 2013). The surrogate is the
Gaussian process of ``trial_and_error`` instead of a support vector machine. All
differences are listed in ``docs/results/rivals.md``.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import distance

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.evolution import reproduce
from selfmodel.recovery.baselines.pareto import best_first
from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)
from selfmodel.recovery.baselines.trial_and_error import KERNEL
from selfmodel.recovery.gaussian_process import posterior
from selfmodel.settings import Settings


@dataclass(frozen=True, eq=False)
class _Population:
    """Genomes with their displacements, m, and duty factors in simulation."""

    genomes: FloatArray
    displacements: FloatArray
    duty_factors: FloatArray


def t_resilience(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Evolves controllers of the healthy robot for displacement, transferability and diversity.

    Every ``settings.period`` generations, a random member of the population is tried on the
    physical robot. The differences between these trials and their simulations train a surrogate,
    which predicts the transferability of all others. The last trial is for the member with the
    largest displacement after the predicted difference.
    """
    trials = PhysicalTrials(problem, settings, on_trial)
    operators = Settings().scaled(settings.population)
    population = _evaluated(
        problem, draw_genomes(rng, (settings.population, problem.design.weights))
    )
    points: list[FloatArray] = []
    differences: list[float] = []

    def predicted(members: _Population) -> FloatArray:
        """Predicted difference of each member, m, ``(n,)``."""
        known = np.array(points).reshape(len(points), members.duty_factors.shape[1])
        return posterior(KERNEL, known, np.array(differences), members.duty_factors)[0]

    while trials.left:
        for _ in range(settings.period):
            entrants = rng.integers(settings.population, size=(settings.population, 2))
            # The population is sorted, so the entrant with the lower index wins.
            parents = population.genomes[entrants.min(axis=1)]
            children = _evaluated(problem, reproduce(parents, draw_genomes, operators, rng))
            both = _joined(population, children)
            chosen = best_first(_objectives(both, predicted(both)))[: settings.population]
            population = _picked(both, chosen)
        member = int(rng.integers(settings.population))
        if trials.left == 1:
            member = int(np.argmax(population.displacements - predicted(population)))
        physical = trials.run(Controller(problem.design, population.genomes[member]))
        points.append(population.duty_factors[member])
        differences.append(abs(float(population.displacements[member]) - physical))
    return trials.done


def _evaluated(problem: Problem, genomes: FloatArray) -> _Population:
    scores, duty = problem.evaluate([Controller(problem.design, genome) for genome in genomes])
    # A gait that falls, or goes backwards, has a displacement of 0.
    return _Population(genomes, np.maximum(scores, 0.0), np.nan_to_num(duty))


def _joined(one: _Population, other: _Population) -> _Population:
    return _Population(
        np.concatenate([one.genomes, other.genomes]),
        np.concatenate([one.displacements, other.displacements]),
        np.concatenate([one.duty_factors, other.duty_factors]),
    )


def _picked(members: _Population, chosen: np.ndarray) -> _Population:
    return _Population(
        members.genomes[chosen], members.displacements[chosen], members.duty_factors[chosen]
    )


def _objectives(members: _Population, differences: FloatArray) -> FloatArray:
    """Returns displacement, transferability and diversity, to be maximised, ``(n, 3)``.

    Args:
        members: The population.
        differences: Predicted difference between simulation and physical trial, m, ``(n,)``.
    """
    diversity = distance.cdist(members.genomes, members.genomes).mean(axis=1)
    return np.stack([members.displacements, -differences, diversity], axis=1)
