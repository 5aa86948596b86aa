"""Reference trajectories of joints: from a log or a table, or of a controller in simulation."""

from pathlib import Path

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource, Controller, Design, draw_genomes
from selfmodel.errors import InputError
from selfmodel.experiments.trial_logs import logs
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.recordings.tables.table import FORMATS, is_table, read_table
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.scores.tracking import Reference
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour

LEAST_MOTION = 0.02
"""Smallest motion of a joint that can be followed, rad."""

TIME = "time"
"""Name of the column of a table with the time of each row, s."""


def read_reference(path: Path, robot: Robot) -> Reference:
    """Returns the reference trajectory in a file, which begins at time 0.

    Args:
        path: A trial's log, or a table with a column ``time``, s, and columns with the names of
            hinges, rad. Other columns are ignored.
        robot: The robot that is to follow the trajectory.

    Raises:
        InputError: The file cannot be read, or has no column of the robot.
    """
    if path.suffix.lower() == ".mcap":
        (log,) = logs([path])
        return _reference_of(log.trial.behaviour, str(path))
    if not is_table(path):
        raise InputError(
            f"{path}: expected a log (.mcap) or a table ({', '.join(FORMATS)}) as reference"
        )
    hinges = robot.anatomy.hinges
    table = read_table(path, (TIME, *hinges))
    found = tuple(name for name in hinges if name in table.columns)
    if TIME not in table.columns or not found:
        raise InputError(
            f"{path}: expected a column {TIME} and columns with names of joints of {robot.name} "
            f"({', '.join(hinges)}), got {', '.join(table.names) or 'none'}: rename its columns"
        )
    time = table.columns[TIME].astype(np.float64)
    positions = np.stack([table.columns[name].astype(np.float64) for name in found], axis=1)
    return _checked(found, time, positions, str(path))


def simulated_reference(robot: Robot, driver: CommandSource, steps: int) -> Reference:
    """Returns the joint trajectory of a controller of the healthy robot in simulation.

    Args:
        robot: The healthy robot.
        driver: The controller.
        steps: Control steps, at least two.
    """
    run = Simulator(robot, threads=1).run([(INTACT, driver)], steps, ["joint_positions"]).behaviour
    return Reference(run.names.hinges, run.time, run["joint_positions"][0])


def check_moving(reference: Reference) -> None:
    """Checks that the motion of a controller goes on: a pose that is reached is nothing to follow.

    Args:
        reference: The motion.

    Raises:
        InputError: In the second half, no joint moves by ``LEAST_MOTION``.
    """
    second_half = reference.positions[len(reference.time) // 2 :]
    if np.ptp(second_half, axis=0).max() < LEAST_MOTION:
        raise InputError(
            "the first controller, which has random weights, moves the joints into a pose and "
            "stops, so there is no motion to follow: give --controller cpg, whose motion goes on, "
            "another --seed, or --reference FILE"
        )


def random_controller(design: Design, seed: int) -> Controller:
    """Returns a controller with random weights: that of the first trial without a reference file.

    Args:
        design: The design.
        seed: Seed of all random numbers of the recovery.
    """
    return Controller(design, draw_genomes(repair_stream(seed, 0), (design.weights,)))


def _reference_of(behaviour: Behaviour, source: str) -> Reference:
    """Returns the trajectory of the joints that a trial observed at some steps."""
    positions = behaviour["joint_positions"]
    seen = np.isfinite(positions)
    columns = np.flatnonzero(seen.any(axis=0))
    rows = seen[:, columns].all(axis=1)
    hinges = tuple(behaviour.names.hinges[column] for column in columns)
    return _checked(hinges, behaviour.time[rows], positions[rows][:, columns], source)


def _checked(
    hinges: tuple[str, ...], time: FloatArray, positions: FloatArray, source: str
) -> Reference:
    try:
        return Reference(hinges, time - time[:1], positions)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
