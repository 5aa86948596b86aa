"""Random controllers and commands for the tests of any robot."""

import numpy as np

from selfmodel.controllers.cpg import Oscillators
from selfmodel.controllers.network import Controller, draw_weights
from selfmodel.robot.robot import Robot


def random_controllers(robot: Robot, count: int, seed: int = 0) -> list[Controller]:
    """Returns controllers with random weights for a robot."""
    genomes = draw_weights(np.random.default_rng(seed), (count, robot.network.weights))
    return [Controller(robot.network, genome) for genome in genomes]


def random_oscillators(robot: Robot, count: int, seed: int = 0) -> list[Oscillators]:
    """Returns CPGs with random genomes for a robot."""
    genomes = draw_weights(np.random.default_rng(seed), (count, robot.cpg.weights))
    return [Oscillators(robot.cpg, genome) for genome in genomes]


def random_motion(robot: Robot, steps: int, seed: int = 0) -> np.ndarray:
    """Returns smooth motor targets that move every joint, ``(steps, motors)``, rad."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, len(robot.anatomy.motors))
    return 0.6 * np.sin(2 * np.pi * np.arange(steps)[:, None] * robot.control_timestep + phase)
