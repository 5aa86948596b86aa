"""Random controllers, repertoires, commands and trials for the tests of any robot."""

import numpy as np

from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.controllers.playback import played_back
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.repertoire import Origin, Repertoire, model_digest
from selfmodel.robot.designs import cpg_for, network_for
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial, TrialPlan


def random_controllers(robot: Robot, count: int, seed: int = 0) -> list[Controller]:
    """Returns networks with random weights for a robot."""
    return random_of(network_for(robot), count, seed)


def random_cpgs(robot: Robot, count: int, seed: int = 0) -> list[Controller]:
    """Returns CPGs with random genomes for a robot."""
    return random_of(cpg_for(robot), count, seed)


def random_of(design: Design, count: int, seed: int = 0) -> list[Controller]:
    """Returns controllers of a design with random genomes."""
    genomes = draw_genomes(np.random.default_rng(seed), (count, design.weights))
    return [Controller(design, genome) for genome in genomes]


def random_repertoire(robot: Robot, gaits: int = 7) -> Repertoire:
    """Returns networks with random weights, scores and duty factors of four feet."""
    rng, design = np.random.default_rng(0), network_for(robot)
    genomes = draw_genomes(rng, (gaits, design.weights))
    origin = Origin(robot.name, model_digest(robot), 60, 100, 20, 3, "0.1.0")
    return Repertoire(design, genomes, rng.random(gaits), rng.random((gaits, 4)), origin)


def random_motion(robot: Robot, steps: int, seed: int = 0) -> np.ndarray:
    """Returns smooth motor targets that move every joint, ``(steps, motors)``, rad."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, len(robot.anatomy.motors))
    return 0.6 * np.sin(2 * np.pi * np.arange(steps)[:, None] * robot.control_timestep + phase)


def moving_trial(robot: Robot, physical: SimulatedRobot, seed: int, steps: int = 200) -> Trial:
    """Returns a healthy trial in which every joint moves; its path has the number of the seed."""
    driver = played_back(robot.anatomy.motors, random_motion(robot, steps, seed))
    plan = TrialPlan("made-up", "before", driver, steps, 0)
    trajectory = collect(robot.anatomy.names, physical.run(driver, steps))
    return Trial(plan, robot.name, trajectory, f"{seed}.mcap")
