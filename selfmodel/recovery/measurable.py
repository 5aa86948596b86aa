"""Which scores can be measured on a physical robot: refused before the first trial if not."""

from collections.abc import Collection

import numpy as np

from selfmodel.errors import InputError
from selfmodel.physical.interface import ObservedRobot, PhysicalRobot
from selfmodel.recovery.scores import SCORES, Score
from selfmodel.recovery.tracking import TRACKING
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trial import Trial


def observed_of(*robots: PhysicalRobot) -> frozenset[Signal]:
    """Returns the signals that all of some physical robots observe, as far as they declare it."""
    declared = [robot.signals for robot in robots if isinstance(robot, ObservedRobot)]
    return frozenset(SIGNALS).intersection(*declared)


def observed_in(trial: Trial) -> frozenset[Signal]:
    """Returns the signals of which a trial has some number, and those without a column."""
    signals = trial.trajectory.signals
    return frozenset(
        one for one in SIGNALS if np.isfinite(signals[one]).any() or not signals[one].size
    )


def check_measurable(
    score: Score, robot: Robot, observed: Collection[Signal] = frozenset(SIGNALS)
) -> None:
    """Raises ``InputError``, which names other scores, if a score cannot be measured on a robot.

    Args:
        score: Fitness of a repair.
        robot: The robot as its model describes it.
        observed: Signals that are observed of the physical robot.
    """
    if reason := _obstacle(score, robot, observed):
        others = [name for name, one in SCORES.items() if not _obstacle(one, robot, observed)]
        if "joint_positions" in observed:
            others.append(f"{TRACKING} (with --reference FILE, or --controller cpg)")
        raise InputError(f"{reason}: give --score {' or '.join(others) or 'package.module:object'}")


def _obstacle(score: Score, robot: Robot, observed: Collection[Signal]) -> str:
    """Returns why a score cannot be measured on a robot; "" if it can."""
    if score.needs_free_base and robot.has_fixed_base:
        return f"the base of {robot.name} is fixed, and the score {score.name} needs one that moves"
    if score.needs_touch and all(one.kind != "touch" for one in robot.anatomy.sensors):
        return f"{robot.name} has no touch sensors, and the score {score.name} needs some"
    lacking = [one for one in score.record if one not in (*observed, *score.optional)]
    if not lacking:
        return ""
    return f"{robot.name} does not observe {', '.join(lacking)}, which the score {score.name} needs"
