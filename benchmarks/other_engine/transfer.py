"""Displacements of given gaits in both engines, with the healthy robot."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.other_engine.environment import BulletEnvironment, physical_robot
from benchmarks.other_engine.reality import Reality, draw_reality, ideal_reality
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs import load_controller
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import collect, forward_displacement


def transfer_lines(robot: Robot, gaits: Sequence[Path], seeds: Sequence[int]) -> Iterator[str]:
    """Yields a Markdown table, line by line: a row per gait, m in a trial of the paper's length.

    Args:
        robot: The healthy robot.
        gaits: Files of its controllers.
        seeds: Seeds of robots in PyBullet.
    """
    realities = [ideal_reality(robot), *(draw_reality(robot, seed) for seed in seeds)]
    names = ["gait", "MuJoCo", "PyBullet, ideal", *(f"PyBullet, robot {seed}" for seed in seeds)]
    yield f"| {' | '.join(names)} |"
    yield "|---" * len(names) + "|"
    for path in gaits:
        gait = load_controller(path)
        found = [_in_mujoco(robot, gait), *(_in_bullet(robot, gait, one) for one in realities)]
        yield f"| {path.stem} | {' | '.join(f'{value:.1f}' for value in found)} |"


def _in_mujoco(robot: Robot, gait: Controller) -> float:
    runs = [(INTACT, gait)]
    result = Simulator(robot, threads=1).run(runs, Settings().steps, ("base_position",))
    return float(forward_displacement(result.behaviour)[0])


def _in_bullet(robot: Robot, gait: Controller, reality: Reality) -> float:
    with BulletEnvironment(robot, reality) as environment:
        samples = physical_robot(environment, robot).run(gait, Settings().steps)
        return float(forward_displacement(collect(robot.anatomy.names, samples)))
