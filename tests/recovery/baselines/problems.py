"""Small problems for the tests of baselines."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.evolution import Evolution
from selfmodel.recovery.baselines.genome_search import genome_search
from selfmodel.recovery.baselines.measurement import Track
from selfmodel.recovery.baselines.problem import Problem
from selfmodel.recovery.repertoire.repertoire import Origin, Repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.helpers.robots.stub_robot import StubRobot

NOISY_EA = partial(Evolution, noisy=True)

LEVEL = np.array([0.0, 0.0, 1.0])
"""Normal of a level ground."""

STEPS = 10


def first_weight(controller: Controller) -> float:
    """The displacement of a controller in these problems: from 0 to 2 m."""
    return float(controller.genome[0]) + 1


def fitness(controllers: Sequence[Controller]) -> FloatArray:
    return np.array([first_weight(one) for one in controllers])


def evaluate(controllers: Sequence[Controller]) -> tuple[FloatArray, FloatArray]:
    """The displacements, and duty factors from the first four weights."""
    duty = np.array([(one.genome[:4] + 1) / 2 for one in controllers])
    return fitness(controllers), duty


def problem_of(
    robot: Robot, displacement: Callable[[Controller], float] = first_weight, **given: object
) -> Problem:
    """A problem whose physical robot goes as far as a function of its controller requires."""
    parts = {
        "track": Track(StubRobot(robot, displacement), robot, LEVEL, STEPS),
        "design": network_for(robot),
        "evaluate": evaluate,
        "healthy": fitness,
        "hidden": fitness,
        "search": genome_search(NOISY_EA, Settings().scaled(8)),
        "repertoire": repertoire_of(robot, [0.2, 1.5, 0.9], [[0.1] * 4, [0.5] * 4, [0.9] * 4]),
    }
    return Problem(**{**parts, **given})


def repertoire_of(
    robot: Robot, displacements: Sequence[float], duty_factors: Sequence[Sequence[float]]
) -> Repertoire:
    """A repertoire of gaits whose first weight sets the displacement in ten steps."""
    design = network_for(robot)
    genomes = np.zeros((len(displacements), design.weights))
    genomes[:, 0] = np.array(displacements) - 1
    origin = Origin("quadruped", "0" * 64, 10, 3, 20, 0, "0.1")
    return Repertoire(design, genomes, np.array(displacements), np.array(duty_factors), origin)
