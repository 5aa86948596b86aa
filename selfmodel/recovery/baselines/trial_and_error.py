"""Intelligent Trial and Error (IT&E): Bayesian optimisation over a repertoire, no diagnosis.

Source: A. Cully, J. Clune, D. Tarapore and J.-B. Mouret, *Robots that can adapt like animals*
(Nature 521:503, 2015), Methods; the constants are also those of the authors' program
(github.com/resibots/ITE, ``hexa_bomean.cpp``).
"""

import numpy as np

from selfmodel.errors import InputError
from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)
from selfmodel.recovery.gaussian_process import Kernel, posterior

KERNEL = Kernel(length_scale=0.4, noise=0.001)
"""Length scale rho = 0.4 over duty factors, variance of the noise 0.001. Source: the article."""

EXPLORATION = 0.05
"""Weight kappa of the standard deviation in the upper confidence bound. Source: the article."""

CLOSE_ENOUGH = 0.9
"""The trials end when the best of them reaches this part of the best prediction: alpha of the
article."""


def trial_and_error(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Tries the gait of a repertoire with the largest upper confidence bound, again and again.

    The Gaussian process predicts the difference between the speed of a gait on the physical robot
    and in the repertoire. Speeds are in m/s: with the published constants, the prior standard
    deviation is 1 in the unit of the performance.

    Raises:
        InputError: The problem has no repertoire.
    """
    del rng  # the method has no random choices
    repertoire = problem.repertoire
    if repertoire is None:
        raise InputError(
            "trial-and-error needs a repertoire of the healthy robot, and got none: make one with "
            "`selfmodel repertoire make`"
        )
    timestep = problem.track.robot.control_timestep
    predicted = repertoire.scores / (repertoire.origin.steps * timestep)
    duration = problem.track.steps * timestep
    trials = PhysicalTrials(problem, settings, on_trial)
    tried: list[int] = []
    speeds: list[float] = []
    while trials.left:
        correction, deviation = posterior(
            KERNEL,
            repertoire.descriptors[tried],
            np.array(speeds) - predicted[tried],
            repertoire.descriptors,
        )
        expected = predicted + correction
        if speeds and max(speeds) >= CLOSE_ENOUGH * expected.max():
            break
        tried.append(int(np.argmax(expected + EXPLORATION * deviation)))
        speeds.append(trials.run(repertoire.controller(tried[-1])) / duration)
    return trials.done
