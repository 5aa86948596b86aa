"""The score of a recovery by name, with the first controller that the score implies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel import plugins
from selfmodel.arguments import read_logs
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource, Controller, Design, draw_genomes
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.recordings.recording import TABLE
from selfmodel.logs.recordings.tables import FORMATS, is_table, read_table
from selfmodel.recovery.recover import random_stream
from selfmodel.recovery.scores import UPRIGHT, Score, upright_within
from selfmodel.recovery.tracking import TRACKING, Reference, tracking
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import Entry
from selfmodel.trials.behaviour import Behaviour

LEAST_MOTION = 0.02
"""Smallest motion of a joint that can be followed, rad."""

TIME = "time"
"""Name of the column of a table with the time of each row, s."""


@dataclass(frozen=True)
class ChosenScore:
    """A score and the first controller of the recovery.

    Attributes:
        score: Fitness of the repair.
        gait: The controller whose motion in simulation is the reference trajectory; None if the
            first controller is to be evolved.
    """

    score: Score
    gait: Controller | None = None


def choose_score(
    name: str,
    entry: Entry,
    design: Design,
    *,
    steps: int,
    seed: int,
    reference: Path | None = None,
    gait: Controller | None = None,
    max_speed: float | None = None,
    max_torque: float | None = None,
    max_self_collision: float | None = None,
) -> ChosenScore:
    """Returns the score of that name for a robot.

    Args:
        name: ``displacement``, ``upright``, ``energy``, ``return`` or ``tracking``; the name of an
            entry point in the group ``selfmodel.scores``, or ``package.module:object``.
        entry: The robot.
        design: Design of the controllers.
        steps: Control steps of a trial.
        seed: Seed of all random numbers of the recovery.
        reference: File of the trajectory to follow; None for the motion of the first controller in
            simulation.
        gait: The first controller; None for one with random weights if its motion is needed.
        max_speed: Largest speed of a joint, rad/s; None for no limit.
        max_torque: Largest torque of a joint, N m; None for no limit.
        max_self_collision: Largest depth to which two bodies penetrate each other, m; None for no
            limit.

    Raises:
        InputError: The name is unknown or the robot has no such score, a reference or a limit is
            given for another score, a limit is out of range, or the motion of the first controller
            stops.
    """
    robot = entry.robot()
    check_score(name, entry)
    if reference is not None and name != TRACKING:
        raise InputError(f"--reference is a trajectory for --score {TRACKING}, got {name}")
    limits = (max_speed, max_torque, max_self_collision)
    if any(limit is not None for limit in limits):
        return ChosenScore(_limited(name, limits), gait)
    if name != TRACKING:
        return ChosenScore(plugins.score(name, robot.name, entry), gait)
    if reference is not None:
        return ChosenScore(tracking(read_reference(reference, robot), robot), gait)
    first = gait or random_controller(design, seed)
    motion = simulated_reference(robot, first, steps)
    check_moving(motion)
    return ChosenScore(tracking(motion, robot), first)


def _limited(name: str, given: Sequence[float | None]) -> Score:
    """Returns the score ``upright`` with limits.

    Args:
        name: Name of the score.
        given: Limits of ``upright_within``; None for no limit.
    """
    if name != UPRIGHT.name:
        raise InputError(
            f"--max-joint-speed, --max-joint-torque and --max-self-collision are limits of "
            f"--score {UPRIGHT.name}, got {name}"
        )
    speed, torque, depth = given
    for option, limit, unit, quantity in (
        ("--max-joint-speed", speed, "rad/s", "speed"),
        ("--max-joint-torque", torque, "N m", "torque"),
    ):
        if limit is not None and not limit > 0:
            raise InputError(
                f"expected {option} above 0 {unit}, got {limit:g}: give the largest {quantity} of "
                f"a joint, or leave the option out"
            )
    if depth is not None and not depth >= 0:
        raise InputError(
            f"expected --max-self-collision of 0 m or above, got {depth:g}: give the largest depth "
            f"to which two bodies may penetrate each other, or leave the option out"
        )
    return upright_within(*(math.inf if limit is None else limit for limit in given))


def check_score(name: str, entry: Entry) -> None:
    """Checks that a robot has a score of that name.

    Args:
        name: Name of the score.
        entry: The robot.

    Raises:
        InputError: The name is unknown, the robot has no task with rewards, or the score is a
            displacement and the base is fixed.
    """
    if name != TRACKING:
        robot = entry.robot()
        check_motion(plugins.score(name, robot.name, entry), robot)


def check_motion(score: Score, robot: Robot) -> None:
    """Checks that the base of a robot moves if its score is a displacement.

    Args:
        score: The score.
        robot: The robot.

    Raises:
        InputError: The score is a displacement and the base is fixed.
    """
    if robot.has_fixed_base and score.needs_free_base:
        raise InputError(
            f"the base of {robot.name} is fixed, and the score {score.name} is a displacement of "
            f"the base: give --score {TRACKING}, with --reference FILE for a joint trajectory to "
            f"follow, or with --controller cpg alone for the motion of a random CPG"
        )


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
        (log,) = read_logs([path])
        return _reference_of(log.trial.behaviour, str(path))
    if not is_table(path):
        raise InputError(
            f"{path}: expected a log (.mcap) or a table ({', '.join(FORMATS)}) as reference"
        )
    hinges = robot.anatomy.hinges
    table = read_table(path, (TIME, *hinges)).series[TABLE]
    found = tuple(name for name in hinges if name in table.columns)
    if TIME not in table.columns or not found:
        raise InputError(
            f"{path}: expected a column {TIME} and columns with names of joints of {robot.name} "
            f"({', '.join(hinges)}), got {', '.join(table.names) or 'none'}: rename its columns"
        )
    time = table.columns[TIME].values[:, 0]
    positions = np.concatenate([table.columns[name].values for name in found], axis=1)
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
    return Controller(design, draw_genomes(random_stream(seed, "repair"), (design.weights,)))


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
