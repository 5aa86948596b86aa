"""The score of a recovery by name, with the first controller that the score implies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from selfmodel.controllers.controller import Controller, Design
from selfmodel.errors import InputError
from selfmodel.experiments import plugins
from selfmodel.experiments.references import (
    check_moving,
    random_controller,
    read_reference,
    simulated_reference,
)
from selfmodel.recovery.scores.fitness import Score
from selfmodel.recovery.scores.joint_limits import upright_within
from selfmodel.recovery.scores.tracking import TRACKING, tracking
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.robot.robot import Robot
from selfmodel.tasks import Entry


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
